"""Measures the figures of the documentation anew and puts them into its pages, with date and commit.

`python -m pages status validation robustness` measures, keeps each record in `docs/figures/` and writes the sections
between the marks of README.md and docs/. Every figure there is computed in this package or in `validation/`.
`python -m pages tables` writes the tables that come from code.
"""
