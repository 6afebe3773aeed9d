"""List of all sensor faults that a study can simulate.

A fault is a key of a study and a function of a recording. To add one, write a function and a line in its family.
"""

from __future__ import annotations

from collections.abc import Mapping

from oarlock._core import Model
from oarlock.evaluation.study.faults.dropout import dropout
from oarlock.evaluation.study.faults.fault import Case, Fault, Names
from oarlock.evaluation.study.faults.magnetic import LASTING, magnetic
from oarlock.evaluation.study.faults.readings import readings
from oarlock.evaluation.study.faults.stamps import stamps
from oarlock.evaluation.study.keys import StudyKey, Value, by_name
from oarlock.evaluation.study.trial import StudyTrial
from oarlock.recording.recording import Recording


def faults_of(model: Model) -> tuple[Fault, ...]:
    """All faults of a model's streams, in the order in which they are applied to a recording."""
    names = Names.of(model)
    return (*readings(names), *magnetic(names), *dropout(names), *stamps(names))


def keys_of_faults(model: Model) -> dict[str, StudyKey]:
    """Keys of all faults in a study."""
    return by_name([*(fault.key for fault in faults_of(model)), LASTING])


def afflicted(trial: StudyTrial, model: Model, values: Mapping[str, Value], seed: int) -> Recording:
    """The recording of a trial with its faults.

    Raises:
        DataError: a fault leaves no samples, or its value is invalid for this recording.
    """
    case = Case(trial, values, seed)
    recording = trial.recording
    for fault in faults_of(model):
        value = values[fault.key.name]
        if value != fault.key.default:
            recording = fault.spoil(recording, value, case)
    return recording
