"""Readers and writers of other software's files, one module per format, for `oarlock import` and `export`."""
