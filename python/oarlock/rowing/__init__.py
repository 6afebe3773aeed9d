"""Rowing on top of the engine's public face: sculling, sweep rowing, the boat, and the published experiment."""

from __future__ import annotations

from oarlock.rowing.analysis.features import FEATURES, Feature
from oarlock.rowing.analysis.stroke_means import FeatureMean, PhaseCurve
from oarlock.rowing.analysis.stroke_summary import SummaryRow, summarise_strokes
from oarlock.rowing.analysis.targets import TARGET_CLASSES, Target, load_targets
from oarlock.rowing.analysis.technique import Technique, technique
from oarlock.rowing.exports.load import EXPORT_FORMATS, ExportFormat, load_stroke_export
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.field.trial import FieldTrial, simulate_field
from oarlock.rowing.figure.shapes import rowing_look, stroke_marks
from oarlock.rowing.simulation.anthropometry import anthropometry
from oarlock.rowing.simulation.boat import Boat, HullMotion
from oarlock.rowing.simulation.ergometer import ErgometerShape, Machine, ergometer_piece
from oarlock.rowing.simulation.hull import HullRotation, on_hull
from oarlock.rowing.simulation.motion import Piece, row_piece, sculling
from oarlock.rowing.simulation.noise import CONDITIONS, TABLE_4_NOISE, ImuNoise, SimulatedCondition
from oarlock.rowing.simulation.pitch import HullForm, HullPitch, hull_pitch
from oarlock.rowing.simulation.rail import on_unknown_rail
from oarlock.rowing.simulation.session_skin import session_skin
from oarlock.rowing.simulation.simulators import SIMULATORS, FieldSimulator, ScullingSimulator
from oarlock.rowing.simulation.stretcher import adjusted_stretcher
from oarlock.rowing.simulation.stroke_shape import StrokeShape
from oarlock.rowing.simulation.sweep import SweepShape, sweep_piece, sweeping
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.rowing.strokes.files import save_strokes
from oarlock.rowing.strokes.find_strokes import find_strokes
from oarlock.rowing.strokes.live_strokes import LiveStrokes, StrokeEvent
from oarlock.rowing.strokes.strokes import Strokes
from oarlock.rowing.strokes.table import StrokeTable

__all__ = [
    "CONDITIONS",
    "EXPORT_FORMATS",
    "FEATURES",
    "SIMULATORS",
    "TABLE_4_NOISE",
    "TARGET_CLASSES",
    "Boat",
    "ErgometerShape",
    "ExportFormat",
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
    "SummaryRow",
    "SweepShape",
    "Target",
    "Technique",
    "adjusted_stretcher",
    "anthropometry",
    "ergometer_piece",
    "find_strokes",
    "hull_pitch",
    "load_stroke_export",
    "load_targets",
    "on_hull",
    "on_unknown_rail",
    "row_piece",
    "rowing_look",
    "save_strokes",
    "sculling",
    "session_skin",
    "simulate_field",
    "stroke_marks",
    "summarise_strokes",
    "sweep_piece",
    "sweeping",
    "technique",
]
