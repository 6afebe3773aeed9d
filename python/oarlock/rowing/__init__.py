"""Rowing on top of the engine's public face: sculling, sweep rowing, the boat, and the published experiment."""

from __future__ import annotations

from oarlock.rowing.anthropometry import anthropometry
from oarlock.rowing.boat import Boat, HullMotion
from oarlock.rowing.ergometer import ErgometerShape, Machine, ergometer_piece
from oarlock.rowing.features import FEATURES, Feature
from oarlock.rowing.field import FieldEffects, FieldTrial, simulate_field
from oarlock.rowing.hull import HullRotation, on_hull
from oarlock.rowing.live_strokes import LiveStrokes, StrokeEvent
from oarlock.rowing.motion import Piece, row_piece, sculling
from oarlock.rowing.noise import CONDITIONS, TABLE_4_NOISE, ImuNoise, SimulatedCondition
from oarlock.rowing.pitch import HullForm, HullPitch, hull_pitch
from oarlock.rowing.rail import on_unknown_rail
from oarlock.rowing.session_skin import session_skin
from oarlock.rowing.shapes import rowing_look, stroke_marks
from oarlock.rowing.simulators import SIMULATORS, FieldSimulator, ScullingSimulator
from oarlock.rowing.stretcher import adjusted_stretcher
from oarlock.rowing.stroke import StrokeShape
from oarlock.rowing.stroke_means import FeatureMean, PhaseCurve
from oarlock.rowing.stroke_table import StrokeTable
from oarlock.rowing.strokes import Strokes, find_strokes
from oarlock.rowing.sweep import SweepShape, sweep_piece, sweeping
from oarlock.rowing.targets import TARGET_CLASSES, Target, load_targets
from oarlock.rowing.technique import Technique, technique
from oarlock.rowing.timing import StrokeTiming

__all__ = [
    "CONDITIONS",
    "FEATURES",
    "SIMULATORS",
    "TABLE_4_NOISE",
    "TARGET_CLASSES",
    "Boat",
    "ErgometerShape",
    "Feature",
    "FeatureMean",
    "FieldEffects",
    "FieldSimulator",
    "FieldTrial",
    "HullForm",
    "HullMotion",
    "HullPitch",
    "HullRotation",
    "ImuNoise",
    "LiveStrokes",
    "Machine",
    "PhaseCurve",
    "Piece",
    "ScullingSimulator",
    "SimulatedCondition",
    "StrokeEvent",
    "StrokeShape",
    "StrokeTable",
    "StrokeTiming",
    "Strokes",
    "SweepShape",
    "Target",
    "Technique",
    "adjusted_stretcher",
    "anthropometry",
    "ergometer_piece",
    "find_strokes",
    "hull_pitch",
    "load_targets",
    "on_hull",
    "on_unknown_rail",
    "row_piece",
    "rowing_look",
    "sculling",
    "session_skin",
    "simulate_field",
    "stroke_marks",
    "sweep_piece",
    "sweeping",
    "technique",
]
