"""Measures the figures of the documentation anew and puts them into its pages, with date and commit.

`python -m oarlock_lab.pages status validation robustness` measures, saves each record in `docs/figures/` and writes the
sections between the marks of README.md and docs/. Every figure there is computed here or in `oarlock_lab.validation`.
`python -m oarlock_lab.pages tables` writes the tables that come from code.
"""
