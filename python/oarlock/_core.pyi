"""Types of the compiled engine, for type checkers. Arrays are float64; time in s, angles in rad, lengths in m."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, Unpack, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oarlock.model.description import ModelDescription
from oarlock.model.jacobians import FrameJacobian, MeasurementJacobian
from oarlock.storage.errors import DataError, DivergedError, ModelError
from oarlock.tracking.joint_state import JointState
from oarlock.tracking.settings import Settings

_Floats = NDArray[np.float64]

# Protocols of the package's objects that the engine reads, so that this stub imports no module that uses the engine.
class _BaseMotion(Protocol):
    @property
    def rotation(self) -> ArrayLike: ...
    @property
    def angular_velocity_rad_s(self) -> ArrayLike: ...
    @property
    def angular_acceleration_rad_s2(self) -> ArrayLike: ...
    @property
    def acceleration_m_s2(self) -> ArrayLike: ...

class _Clock(Protocol):
    @property
    def offset_s(self) -> float: ...
    @property
    def drift(self) -> float: ...

class _EncoderScale(Protocol):
    @property
    def zero(self) -> float: ...
    @property
    def scale(self) -> float: ...

class _Corrections(Protocol):
    @property
    def gyro_biases_rad_s(self) -> Mapping[str, _Floats]: ...
    @property
    def accel_biases_m_s2(self) -> Mapping[str, _Floats]: ...
    @property
    def accel_scales(self) -> Mapping[str, _Floats]: ...
    @property
    def mag_offsets_ut(self) -> Mapping[str, _Floats]: ...
    @property
    def mag_matrices(self) -> Mapping[str, _Floats]: ...
    @property
    def clocks(self) -> Mapping[str, _Clock]: ...
    @property
    def encoders(self) -> Mapping[str, _EncoderScale]: ...

class _Calibration(_Corrections, Protocol):
    @property
    def parameters(self) -> Mapping[str, float]: ...
    @property
    def mounts(self) -> Mapping[str, tuple[_Floats, _Floats]]: ...

class _Recording(Protocol):
    @property
    def streams(self) -> Sequence[Any]: ...

__version__: str

@final
class Model:
    name: str
    description: str
    text: str
    path: str
    parameters: dict[str, float]
    length_names: list[str]
    joint_names: list[str]
    coordinate_names: list[str]
    structure: str
    frame_names: list[str]
    frame_parents: list[int]
    joint_origins: list[tuple[float, float, float]]
    sensor_names: list[str]
    closure_names: list[str]
    measurement_names: list[str]
    state_names: list[str]
    @staticmethod
    def from_toml(text: str, path: str, parameters: Mapping[str, float]) -> Model: ...
    def with_parameters(self, values: Mapping[str, float] | None = None, **named: float) -> Model: ...
    def with_tables(self, changes: Mapping[str, Any]) -> Model: ...
    def with_joint(self, name: str, **keys: Any) -> Model: ...
    def with_frame(self, name: str, **keys: Any) -> Model: ...
    def with_sensor(self, name: str, **keys: Any) -> Model: ...
    def with_closure(self, name: str, **keys: Any) -> Model: ...
    def with_units(self, names: Iterable[str]) -> Model: ...
    def without(
        self,
        *,
        joints: Iterable[str] | None = None,
        frames: Iterable[str] | None = None,
        sensors: Iterable[str] | None = None,
        closures: Iterable[str] | None = None,
        base_accelerations: Iterable[str] | None = None,
    ) -> Model: ...
    def describe(self, calibration: _Calibration | None = None) -> ModelDescription: ...
    def forward_kinematics(self, q: ArrayLike, lengths: ArrayLike | None = None) -> _Floats: ...
    def frame_jacobian(
        self, q: ArrayLike, frames: Sequence[str] | None = None, lengths: ArrayLike | None = None
    ) -> FrameJacobian: ...
    def predict_measurements(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, base: _BaseMotion | None = None
    ) -> _Floats: ...
    def measurement_jacobian(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, base: _BaseMotion | None = None
    ) -> MeasurementJacobian: ...

@final
class Config:
    structure: str | None
    estimate: list[str]
    closures: bool
    contacts: bool
    process_noise: str
    magnetometer: str
    filter: str
    initial_q: list[float] | None
    alpha: float
    beta: float
    kappa: float
    merge_s: float
    sample_rate_hz: float | None
    inputs: list[str] | None
    stamp_std_s: dict[str, float] | None
    wait_s: float
    start_window_s: float
    gate: bool
    gate_patience_s: float
    belief_interval_s: float
    output_rate_hz: float | None
    def __new__(cls, **keys: Unpack[Settings]) -> Self: ...
    def to_dict(self) -> dict[str, Any]: ...

@final
class Belief:
    def __new__(
        cls,
        time_s: float,
        mean: ArrayLike,
        covariance: ArrayLike,
        seen_s: ArrayLike,
        rejected_since_s: ArrayLike,
        state_names: list[str],
        memory: Sequence[Sequence[float]],
        hypothesis: tuple[int, float],
        rivals: Sequence[Belief],
        links: ArrayLike,
    ) -> Self: ...
    time_s: float
    mean: _Floats
    covariance: _Floats
    seen_s: _Floats
    rejected_since_s: _Floats
    state_names: list[str]
    memory: list[list[float]]
    hypothesis: tuple[int, float]
    rivals: list[Belief]
    links: _Floats
    std: _Floats
    def __getitem__(self, key: str, /) -> JointState: ...
    def __contains__(self, key: object, /) -> bool: ...
    def __iter__(self) -> Iterator[str]: ...
    def keys(self) -> list[str]: ...

@final
class Info:
    time_s: float
    status: str
    innovation: _Floats
    nis: float
    inertial: tuple[float, int]
    sensors: dict[str, dict[str, Any]]
    lost: bool

@final
class Sample:
    __hash__: ClassVar[None]  # type: ignore[assignment]
    time_s: float

@final
class Tracker:
    def __new__(
        cls,
        model: Model,
        calibration: _Calibration | None = None,
        config: Config | None = None,
        belief: Belief | None = None,
    ) -> Self: ...
    belief: Belief | None
    state_names: list[str]
    def sample(self, time_s: float, readings: Mapping[str, Any]) -> Sample: ...
    def __copy__(self) -> Self: ...
    def __deepcopy__(self, _memo: Any) -> Self: ...
    def corrected_time_s(self, stream: str, time_s: float) -> float: ...
    def samples(self, recording: _Recording) -> list[Sample]: ...
    def step(
        self, sample: Sample | float, readings: Mapping[str, Any] | None = None
    ) -> tuple[Belief | None, Info]: ...
    def push(
        self, stream: str, stamp_s: float, readings: Mapping[str, Any] | float
    ) -> list[tuple[Belief, Info]]: ...
    def flush(self) -> list[tuple[Belief, Info]]: ...
    @property
    def arrivals(self) -> dict[str, int]: ...

@final
class Run:
    last_belief: Belief | None
    state_names: list[str]
    source_names: list[str]
    notes: list[str]
    nominal_mounts: list[str]
    structure: str
    steps: int
    smoothed: bool
    def time_s(self) -> _Floats: ...
    def states(self, columns: Sequence[int | None], std: bool) -> _Floats: ...
    def inputs(self) -> tuple[list[int], _Floats]: ...
    @property
    def config(self) -> Config: ...
    def observed(self) -> NDArray[np.uint8]: ...
    def off_axis(self) -> tuple[list[str], _Floats]: ...
    def infos(self) -> dict[str, NDArray[Any]]: ...
    def counts(self) -> list[dict[str, Any]]: ...
    def beliefs(self) -> list[tuple[float, _Floats, _Floats]]: ...
    def smooth(self, room: int, progress: Callable[[float], object] | None) -> Run: ...

def true_times_s(clock_: _Clock, stamps_s: ArrayLike) -> _Floats: ...
def encoder_values(encoder_: _EncoderScale, readings: ArrayLike) -> _Floats: ...
def corrected_readings(
    calibration: _Corrections, unit: str, field: str, readings: ArrayLike
) -> _Floats | None: ...
def track(
    model: Model,
    recording: _Recording,
    calibration: _Calibration | None,
    config: Config,
    start: Belief | None,
    progress: Callable[[float], object] | None,
) -> Run: ...
def score_many(
    model: Model,
    jobs: Sequence[tuple[Any, Any, Config]],
    settle_s: float,
    window_s: float,
    threads: int | None,
    progress: Callable[[float], object] | None,
) -> list[Any]: ...
def track_many(
    model: Model,
    jobs: Sequence[tuple[_Recording, _Calibration | None, Config]],
    smooth: bool,
    threads: int | None,
    progress: Callable[[float], object] | None,
) -> list[tuple[Run, list[str], float, float | None] | ModelError | DataError | DivergedError]: ...
def race(
    model: Model, recording: _Recording, configs: Sequence[Config], warm: int, seconds: float
) -> dict[str, Any]: ...
def imu_signals(
    model: Model,
    calibration: _Calibration | None,
    q: ArrayLike,
    step_s: float,
    root_acceleration: ArrayLike,
    azimuth_rad: float,
) -> _Floats: ...
def find_hinge_chain(
    sensors: list[dict[str, Any]],
    up_in_world: Sequence[float],
    gravity_m_s2: float,
    still_s: tuple[float, float] | None,
    first_turn_positive: bool,
) -> dict[str, Any]: ...
def find_joint_center(
    first: dict[str, Any],
    second: dict[str, Any],
    expected: list[list[float]],
    window_s: float,
    prior_std_m: float,
) -> dict[str, Any]: ...
def find_hinge_axis(
    first: dict[str, Any],
    second: dict[str, Any],
    nominal: list[list[float]],
    prior_std_rad: list[float],
    window_s: float,
) -> dict[str, Any]: ...
def find_pose_mounts(
    sensors: list[dict[str, Any]],
    up_in_world: Sequence[float],
    still_s: tuple[float, float] | None,
    posture_std_rad: float,
) -> list[dict[str, Any]]: ...
def find_local_field(sensors: list[dict[str, Any]]) -> dict[str, Any]: ...
def read_parquet(
    contents: bytes, most_values: int, without_lists: bool = False
) -> tuple[dict[str, NDArray[Any] | tuple[NDArray[np.int32], list[str]]], dict[str, str]]: ...
def write_parquet(
    file: Path,
    columns: Mapping[str, NDArray[Any] | tuple[NDArray[np.int32], Sequence[str]]],
    about: Mapping[str, str] = ...,
) -> None: ...
def read_csv(contents: bytes, names: list[str]) -> list[_Floats] | None: ...
def write_csv(
    file: Path, columns: Mapping[str, NDArray[Any] | tuple[NDArray[np.int32], Sequence[str]]]
) -> None: ...
