"""Readers of public data sets, one file a data set."""
