"""Streams: the readings of one sensor with their time stamps, one class for each kind. The parts of a `Recording`."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from oarlock.storage.array_gate import check_no_infinity, real_array, time_array
from oarlock.storage.arrays import Floats
from oarlock.storage.dataframes import pandas_table, polars_table
from oarlock.storage.errors import DataError
from oarlock.storage.names import check_name
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

ScalarUnit: TypeAlias = Literal["m", "rad"]
MOST_STREAMS = 2000
"""Streams of one recording; a few bytes of a damaged file announce any number of channels."""


_OF_UNITS = ("gyro_rad_s", "accel_m_s2", "mag_ut")


class _Stream:
    """Common part of all kinds of stream: a name, time stamps, and fields with one row for each time stamp."""

    kind: ClassVar[str]
    name: str
    time_s: Floats

    def _admit(self, width: int | None, names: Iterable[str]) -> None:
        name: object = self.name
        if not isinstance(name, str) or not name.strip():
            raise DataError(f"a stream's name must be a non-empty text, got {name!r}")
        check_name(name, "stream")
        self._put("time_s", time_array(self.time_s, f"{self._where}, time_s"))
        for field_name in names:
            self._put(field_name, self._rows(field_name, width))

    def _rows(self, field_name: str, width: int | None) -> Floats:
        where = f"{self._where}, {field_name}"
        shape = (None,) if width is None else (None, width)
        rows = real_array(getattr(self, field_name), shape, where)
        if len(rows) != len(self.time_s):
            raise DataError(
                f"{where}: has {len(rows)} rows, but time_s has {len(self.time_s)}. Give one row for each time stamp."
            )
        check_no_infinity(rows, self.time_s, where)
        return rows

    def _put(self, field_name: str, value: object) -> None:
        object.__setattr__(self, field_name, value)

    @property
    def _where(self) -> str:
        return f'stream "{self.name}"'

    @property
    def values(self) -> Mapping[str, Floats]:
        """The measured arrays by field name, each (T,), (T, 3) or (T, 4), without those that are None."""
        raise NotImplementedError

    @property
    def rate_hz(self) -> float:
        """Sample rate in Hz: the inverse of the median interval; NaN for a single sample."""
        return 1.0 / float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else float("nan")

    @property
    def missing_share(self) -> float:
        """Share of the values that are NaN, 0 to 1."""
        total = sum(v.size for v in self.values.values())
        return sum(int(np.isnan(v).sum()) for v in self.values.values()) / total

    def columns(self) -> dict[str, Floats]:
        """Time stamps and readings, (T,) each, under names such as `gyro_rad_s_x`."""
        found = {"time_s": self.time_s}
        for name, rows in self.values.items():
            axes = {3: "xyz", 4: "wxyz"}.get(rows.shape[-1], "") if rows.ndim == 2 else ""
            found |= {f"{name}_{axis}": rows[:, k] for k, axis in enumerate(axes)} if axes else {name: rows}
        return found

    def to_pandas(self) -> "pd.DataFrame":
        """The columns as a pandas DataFrame (needs the extra `oarlock[dataframe]`)."""
        return pandas_table(self.columns())

    def to_polars(self) -> "pl.DataFrame":
        """The columns as a polars DataFrame (needs the extra `oarlock[polars]`). Missing numbers are NaN, not null."""
        return polars_table(self.columns())

    def __len__(self) -> int:
        return len(self.time_s)

    def at_rows(self, rows: NDArray[Any] | slice, time_s: Floats | None = None) -> Self:
        """The samples at these indices or where this mask is true, with new time stamps (T,) in s if given."""
        values = {name: array[rows] for name, array in self.values.items()}
        stamps = self.time_s[rows] if time_s is None else time_s
        return replace(self, time_s=stamps, **values)  # type: ignore[type-var]

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        # Uses the constructor, so that the arrays of a copied or unpickled stream are read-only too.
        return type(self), tuple(vars(self)[f] for f in type(self).__match_args__)  # type: ignore[attr-defined]

    def __repr__(self) -> str:
        rate = "one sample" if len(self) == 1 else f"{self.rate_hz:.4g} Hz"
        return (
            f"{type(self).__name__}({self.name!r}: {' '.join(self.values)}, {len(self)} samples, {rate}, "
            f"{self.time_s[0]:.6g} to {self.time_s[-1]:.6g} s, {100 * self.missing_share:.1f} % NaN)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ImuStream(_Stream):
    """Readings of one inertial unit in its own axes. Any quantity may be None (absent) or contain NaN (missing).

    Args:
        name: the sensor's name in the model.
        time_s: (T,) strictly increasing stamps in s.
        gyro_rad_s: (T, 3) angular velocity in rad/s.
        accel_m_s2: (T, 3) specific force in m/s2: about 9.8 upwards at rest.
        mag_ut: (T, 3) magnetic flux density in uT.

    Raises:
        DataError: The time stamps do not increase, a shape is wrong, a value is infinite or not a number, or there is
            no quantity.
    """

    kind: ClassVar[str] = "imu"
    name: str
    time_s: Floats
    gyro_rad_s: Floats | None = None
    accel_m_s2: Floats | None = None
    mag_ut: Floats | None = None

    def __post_init__(self) -> None:
        present = [f for f in _OF_UNITS if getattr(self, f) is not None]
        self._admit(3, present)
        if not present:
            raise DataError(
                f"{self._where}: has no gyro_rad_s, accel_m_s2 or mag_ut. Give one, or leave it out."
            )

    @property
    def values(self) -> Mapping[str, Floats]:
        """The (T, 3) arrays that are present, by field name."""
        fields = {"gyro_rad_s": self.gyro_rad_s, "accel_m_s2": self.accel_m_s2, "mag_ut": self.mag_ut}
        return {name: rows for name, rows in fields.items() if rows is not None}

    def between(self, start_s: float, end_s: float) -> "ImuStream | None":
        """The samples with start_s <= time_s < end_s, stamps unchanged; None if there is none."""
        rows = _rows_between(self.time_s, start_s, end_s)
        if rows is None:
            return None
        return ImuStream(self.name, self.time_s[rows], **{n: v[rows] for n, v in self.values.items()})


@dataclass(frozen=True, eq=False, repr=False)
class ScalarStream(_Stream):
    """One number over time, such as the readings of an encoder.

    Args:
        name: the sensor's or the input joint's name in the model.
        time_s: (T,) strictly increasing stamps in s.
        value: (T,) readings, rad for a hinge and m for a slide; NaN = missing.
        unit: "rad" or "m" if the source states it, so that wrong units are detected; otherwise None.

    Raises:
        DataError: As `ImuStream`, or the unit is neither.
    """

    kind: ClassVar[str] = "scalar"
    name: str
    time_s: Floats
    value: Floats
    unit: ScalarUnit | None = None

    def __post_init__(self) -> None:
        self._admit(None, ["value"])
        if self.unit not in (None, "m", "rad"):
            raise DataError(
                f'{self._where}: unit is {self.unit!r}; expected "rad" or "m". Convert the readings.'
            )

    @property
    def values(self) -> Mapping[str, Floats]:
        """The (T,) readings under the name "value"."""
        return {"value": self.value}

    def between(self, start_s: float, end_s: float) -> "ScalarStream | None":
        """The samples with start_s <= time_s < end_s, stamps unchanged; None if there is none."""
        rows = _rows_between(self.time_s, start_s, end_s)
        return None if rows is None else replace(self, time_s=self.time_s[rows], value=self.value[rows])


@dataclass(frozen=True, eq=False, repr=False)
class VectorStream(_Stream):
    """A measured position over time.

    Args:
        name: the sensor's name in the model.
        time_s: (T,) strictly increasing stamps in s.
        value: (T, 3) position in m, in root axes; NaN = missing.

    Raises:
        DataError: As `ImuStream`.
    """

    kind: ClassVar[str] = "vector"
    name: str
    time_s: Floats
    value: Floats

    def __post_init__(self) -> None:
        self._admit(3, ["value"])

    @property
    def values(self) -> Mapping[str, Floats]:
        """The (T, 3) positions under the name "value"."""
        return {"value": self.value}

    def between(self, start_s: float, end_s: float) -> "VectorStream | None":
        """The samples with start_s <= time_s < end_s, stamps unchanged; None if there is none."""
        rows = _rows_between(self.time_s, start_s, end_s)
        return None if rows is None else replace(self, time_s=self.time_s[rows], value=self.value[rows])


_UNIT_TOLERANCE = 0.01
"""Allowed error of a quaternion's norm, for rounded digits; a larger one indicates that it is no rotation."""


@dataclass(frozen=True, eq=False, repr=False)
class OrientationStream(_Stream):
    """Orientations over time that an inertial unit computes itself.

    Args:
        name: the sensor's name in the model.
        time_s: (T,) strictly increasing stamps in s.
        quat_wxyz: (T, 4) unit quaternions, scalar first: the rotation reference-from-sensor. The z axis of the
            device's reference points up. Either sign; NaN = missing. A norm within 1 % of one is accepted and kept.

    Raises:
        DataError: As `ImuStream`, or a quaternion that is not a unit quaternion.
    """

    kind: ClassVar[str] = "orientation"
    name: str
    time_s: Floats
    quat_wxyz: Floats

    def __post_init__(self) -> None:
        self._admit(4, ["quat_wxyz"])
        with np.errstate(over="ignore"):  # a norm beyond all numbers is refused below
            norm = np.linalg.norm(self.quat_wxyz, axis=1)
        bad = np.flatnonzero(np.abs(norm - 1.0) > _UNIT_TOLERANCE)
        if bad.size:
            raise DataError(
                f"{self._where}, quat_wxyz[{bad[0]}] has the norm {norm[bad[0]]:.4g} at {self.time_s[bad[0]]:g} s "
                f"({bad.size} of {norm.size} are not unit quaternions). "
                "Give w, x, y, z of norm 1, and NaN for a missing reading."
            )

    @property
    def values(self) -> Mapping[str, Floats]:
        """The (T, 4) quaternions under the name "quat_wxyz"."""
        return {"quat_wxyz": self.quat_wxyz}

    def between(self, start_s: float, end_s: float) -> "OrientationStream | None":
        """The samples with start_s <= time_s < end_s, stamps unchanged; None if there is none."""
        rows = _rows_between(self.time_s, start_s, end_s)
        return (
            None if rows is None else replace(self, time_s=self.time_s[rows], quat_wxyz=self.quat_wxyz[rows])
        )


Stream: TypeAlias = ImuStream | ScalarStream | VectorStream | OrientationStream


def _rows_between(time_s: Floats, start_s: float, end_s: float) -> slice | None:
    first, stop = (int(i) for i in np.searchsorted(time_s, [start_s, end_s], side="left"))
    return slice(first, stop) if stop > first else None


def stream_of(name: str, fields: Mapping[str, Any]) -> Stream:
    """The stream that has these fields: `time_s` and those of one kind of stream.

    Raises:
        DataError: `time_s` is missing, or no kind of stream has these fields.
    """
    if "time_s" not in fields:
        raise DataError(f'stream "{name}": has no time_s; give its time stamps in s')
    names = set(fields) - {"time_s"}
    if names and names <= set(_OF_UNITS):
        return ImuStream(name, **fields)
    if names == {"quat_wxyz"}:
        return OrientationStream(name, **fields)
    if "value" in names and names <= {"value", "unit"}:
        return VectorStream(name, **fields) if np.ndim(fields["value"]) == 2 else ScalarStream(name, **fields)
    unknown = sorted(names - {*_OF_UNITS, "quat_wxyz", "value", "unit"})
    advice = (
        did_you_mean(unknown[0], [*_OF_UNITS, "quat_wxyz", "value"])
        if unknown
        else "Give those of one sensor."
    )
    raise DataError(
        f'stream "{name}": no sensor has the fields {", ".join(sorted(names)) or "of none"}. {advice}'
    )


def fields_of_columns(columns: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a stream from columns as `to_pandas` names them: `gyro_rad_s_x`, _y and _z are `gyro_rad_s`."""
    fields: dict[str, Any] = {}
    by_axis: dict[str, dict[str, Any]] = {}
    for column, values in columns.items():
        name, _, axis = str(column).rpartition("_")
        if name and axis in tuple("wxyz"):
            by_axis.setdefault(name, {})[axis] = values
        else:
            fields[str(column)] = values
    return fields | {
        name: np.column_stack([values[axis] for axis in "wxyz" if axis in values])
        for name, values in by_axis.items()
    }
