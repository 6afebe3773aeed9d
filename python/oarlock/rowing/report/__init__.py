"""The report of a rower: strokes, technique, two pieces beside each other, and what each number means."""

from __future__ import annotations
