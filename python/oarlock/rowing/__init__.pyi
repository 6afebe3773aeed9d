"""The public names of `oarlock.rowing` and the modules that define them."""

from .alongside.align import Alignment, align_strokes
from .analysis.features import FEATURES, Feature
from .analysis.live_technique import LiveStroke, LiveTechnique, StrokeEstimates, live_stroke
from .analysis.stroke_means import FeatureMean, PhaseCurve
from .analysis.stroke_summary import SummaryRow, summarise_strokes
from .analysis.targets import TARGET_CLASSES, Target, load_targets
from .analysis.technique import Technique, technique
from .crew.findings import CrewFinding, crew_findings
from .crew.seats import CrewSeat, crew_seats
from .crew.timing import CrewTiming, crew_timing
from .exports.activity import Activity
from .exports.load import EXPORT_FORMATS, ExportFormat, load_export, load_stroke_export
from .field.effects import FieldEffects
from .field.trial import FieldTrial, simulate_field
from .figure.shapes import LiveLook, live_look, rowing_look, stroke_marks
from .report.crew_page import write_crew_report
from .report.export_page import write_strokes_report
from .report.live import StrokeFollower
from .simulation.anthropometry import anthropometry
from .simulation.boat import Boat, HullMotion
from .simulation.emulated import rowing_devices
from .simulation.ergometer import ErgometerShape, Machine, ergometer_piece
from .simulation.hull import HullRotation, on_hull
from .simulation.motion import Piece, row_piece, sculling
from .simulation.noise import CONDITIONS, TABLE_4_NOISE, ImuNoise, SimulatedCondition
from .simulation.pitch import HullForm, HullPitch, hull_pitch
from .simulation.rail import on_unknown_rail
from .simulation.session_skin import session_skin
from .simulation.simulators import SIMULATORS, FieldSimulator, ScullingSimulator
from .simulation.stretcher import adjusted_stretcher
from .simulation.stroke_shape import StrokeShape
from .simulation.sweep import SweepShape, sweep_piece, sweeping
from .simulation.timing import StrokeTiming
from .strokes.files import load_strokes, save_strokes
from .strokes.find_strokes import find_strokes
from .strokes.fit_file import save_fit
from .strokes.live_strokes import LiveStrokes, StrokeEvent
from .strokes.rowingdata_file import save_rowingdata
from .strokes.strokes import Strokes
from .strokes.table import StrokeTable

__all__ = [
    "CONDITIONS",
    "EXPORT_FORMATS",
    "FEATURES",
    "SIMULATORS",
    "TABLE_4_NOISE",
    "TARGET_CLASSES",
    "Activity",
    "Alignment",
    "Boat",
    "CrewFinding",
    "CrewSeat",
    "CrewTiming",
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
    "LiveLook",
    "LiveStroke",
    "LiveStrokes",
    "LiveTechnique",
    "Machine",
    "PhaseCurve",
    "Piece",
    "ScullingSimulator",
    "SimulatedCondition",
    "StrokeEstimates",
    "StrokeEvent",
    "StrokeFollower",
    "StrokeShape",
    "StrokeTable",
    "StrokeTiming",
    "Strokes",
    "SummaryRow",
    "SweepShape",
    "Target",
    "Technique",
    "adjusted_stretcher",
    "align_strokes",
    "anthropometry",
    "crew_findings",
    "crew_seats",
    "crew_timing",
    "ergometer_piece",
    "find_strokes",
    "hull_pitch",
    "live_look",
    "live_stroke",
    "load_export",
    "load_stroke_export",
    "load_strokes",
    "load_targets",
    "on_hull",
    "on_unknown_rail",
    "row_piece",
    "rowing_devices",
    "rowing_look",
    "save_fit",
    "save_rowingdata",
    "save_strokes",
    "sculling",
    "session_skin",
    "simulate_field",
    "stroke_marks",
    "summarise_strokes",
    "sweep_piece",
    "sweeping",
    "technique",
    "write_crew_report",
    "write_strokes_report",
]
