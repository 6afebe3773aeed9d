"""Reproduction of every table and figure of the source paper, compared with the printed values."""
