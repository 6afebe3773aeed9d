"""Sculling as it is on the water: a second simulator, in which nothing is as modelled."""

from __future__ import annotations

from oarlock.rowing.field.effects import GROUPS, FieldEffects
from oarlock.rowing.field.trial import FieldTrial, simulate_field

__all__ = ["GROUPS", "FieldEffects", "FieldTrial", "simulate_field"]
