"""Readers and writers, one file a format; import the one you need."""
