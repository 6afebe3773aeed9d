"""Tracks public recordings with Oarlock and with other software, and scores all by the same rules.

Run with ``python -m oarlock_lab.validation --out out/validation``. What the rules are, and where the data come from:
docs/validation.md.
"""
