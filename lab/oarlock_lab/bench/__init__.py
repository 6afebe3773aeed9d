"""Benchmarks of Oarlock's filters, a textbook filter and other software, for `oarlock lab bench`."""
