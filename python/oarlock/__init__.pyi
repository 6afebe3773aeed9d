"""The public names of Oarlock and the modules that define them."""

from . import (
    calibration,
    evaluation,
    formats,
    markers,
    model,
    recording,
    report,
    simulation,
    studies,
    tracking,
)
from ._core import Belief, Config, Info, Model, Sample, Tracker, __version__
from .evaluation.evaluate import evaluate
from .formats.contents import find_recordings, import_recording
from .formats.export.export import export
from .model.load import load_model
from .pipeline import run
from .recording.calibration import Calibration, load_calibration
from .recording.recording import Recording, load_recording
from .report.fields import write_report
from .simulation.simulate import simulate
from .storage.errors import DataError, DivergedError, ModelError, OarlockError
from .tracking.joint_angles import joint_angles
from .tracking.many import track_many
from .tracking.track import Track, load_track
from .tracking.tracking import smooth, track

__all__ = [
    "Belief",
    "Calibration",
    "Config",
    "DataError",
    "DivergedError",
    "Info",
    "Model",
    "ModelError",
    "OarlockError",
    "Recording",
    "Sample",
    "Track",
    "Tracker",
    "__version__",
    "calibration",
    "evaluate",
    "evaluation",
    "export",
    "find_recordings",
    "formats",
    "import_recording",
    "joint_angles",
    "load_calibration",
    "load_model",
    "load_recording",
    "load_track",
    "markers",
    "model",
    "recording",
    "report",
    "run",
    "simulate",
    "simulation",
    "smooth",
    "studies",
    "track",
    "track_many",
    "tracking",
    "write_report",
]
