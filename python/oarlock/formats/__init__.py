"""Readers and writers of other software's files, one file a format."""
