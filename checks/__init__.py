"""Checks of the project's text: arrows between modules, sizes, names, links. `python -m checks` runs them all."""
