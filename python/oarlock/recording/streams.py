"""Measured streams: what one sensor gave, unchanged, with time stamps and a name."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from oarlock.storage.array_gate import FloatArray, check_no_infinity, real_array, time_array
from oarlock.storage.errors import DataError

ScalarUnit: TypeAlias = Literal["m", "rad"]


class _Stream:
    """What the three kinds of stream share: a name, stamps, and fields of one row per stamp."""

    kind: ClassVar[str]
    name: str
    time_s: FloatArray

    def _admit(self, width: int | None, names: Iterable[str]) -> None:
        name: object = self.name
        if not isinstance(name, str) or not name.strip():
            raise DataError(f"a stream's name must be a text that is not empty, got {name!r}")
        self._put("time_s", time_array(self.time_s, f"{self._where}, time_s"))
        for field_name in names:
            self._put(field_name, self._rows(field_name, width))

    def _rows(self, field_name: str, width: int | None) -> FloatArray:
        where = f"{self._where}, {field_name}"
        shape = (None,) if width is None else (None, width)
        rows = real_array(getattr(self, field_name), shape, where)
        if len(rows) != len(self.time_s):
            raise DataError(
                f"{where}: has {len(rows)} rows, but time_s has {len(self.time_s)}. "
                "Give one row for each time stamp."
            )
        check_no_infinity(rows, self.time_s, where)
        return rows

    def _put(self, field_name: str, value: object) -> None:
        object.__setattr__(self, field_name, value)

    @property
    def _where(self) -> str:
        return f'stream "{self.name}"'

    @property
    def values(self) -> Mapping[str, FloatArray]:
        """The measured arrays by field name, each (T,) or (T, 3); those that are None are left out."""
        raise NotImplementedError

    @property
    def rate_hz(self) -> float:
        """Sample rate in Hz: one over the median step; NaN for a single sample."""
        return 1.0 / float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else float("nan")

    @property
    def missing_share(self) -> float:
        """Share of the values that are NaN, 0 to 1."""
        total = sum(v.size for v in self.values.values())
        return sum(int(np.isnan(v).sum()) for v in self.values.values()) / total

    def __len__(self) -> int:
        return len(self.time_s)

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        # Through the constructor, so that a copy or an unpickled stream is read-only too.
        return type(self), tuple(vars(self)[f] for f in type(self).__match_args__)  # type: ignore[attr-defined]

    def __repr__(self) -> str:
        rate = "one sample" if len(self) == 1 else f"{self.rate_hz:.4g} Hz"
        return (
            f"{type(self).__name__}({self.name!r}: {' '.join(self.values)}, {len(self)} samples, {rate}, "
            f"{self.time_s[0]:.6g} to {self.time_s[-1]:.6g} s, {100 * self.missing_share:.1f} % missing)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ImuStream(_Stream):
    """One inertial unit, in its own axes. Any quantity may be None (absent) or hold NaN (missing).

    Args:
        name: the sensor's name in the model.
        time_s: (T,) strictly increasing stamps in s.
        gyro_rad_s: (T, 3) angular velocity in rad/s.
        accel_m_s2: (T, 3) specific force in m/s2: about 9.8 upwards at rest.
        mag_ut: (T, 3) magnetic flux density in uT.

    Raises:
        DataError: Stamps out of order, another shape, infinite or non-numeric values, or no quantity at all.
    """

    kind: ClassVar[str] = "imu"
    name: str
    time_s: FloatArray
    gyro_rad_s: FloatArray | None = None
    accel_m_s2: FloatArray | None = None
    mag_ut: FloatArray | None = None

    def __post_init__(self) -> None:
        present = [f for f in ("gyro_rad_s", "accel_m_s2", "mag_ut") if getattr(self, f) is not None]
        self._admit(3, present)
        if not present:
            raise DataError(
                f"{self._where}: has no gyro_rad_s, accel_m_s2 or mag_ut. Give one, or leave it out."
            )

    @property
    def values(self) -> Mapping[str, FloatArray]:
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
    """One number over time, such as an encoder's.

    Args:
        name: the sensor's or the input joint's name in the model.
        time_s: (T,) strictly increasing stamps in s.
        value: (T,) readings, rad for a hinge and m for a slide; NaN = missing.
        unit: "rad" or "m" where the source says it, so that a mix-up can be found; None if it does not.

    Raises:
        DataError: As `ImuStream`, or another unit.
    """

    kind: ClassVar[str] = "scalar"
    name: str
    time_s: FloatArray
    value: FloatArray
    unit: ScalarUnit | None = None

    def __post_init__(self) -> None:
        self._admit(None, ["value"])
        if self.unit not in (None, "m", "rad"):
            raise DataError(
                f'{self._where}: unit is {self.unit!r}; readings are held in "rad" or "m". Convert them.'
            )

    @property
    def values(self) -> Mapping[str, FloatArray]:
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
    time_s: FloatArray
    value: FloatArray

    def __post_init__(self) -> None:
        self._admit(3, ["value"])

    @property
    def values(self) -> Mapping[str, FloatArray]:
        """The (T, 3) positions under the name "value"."""
        return {"value": self.value}

    def between(self, start_s: float, end_s: float) -> "VectorStream | None":
        """The samples with start_s <= time_s < end_s, stamps unchanged; None if there is none."""
        rows = _rows_between(self.time_s, start_s, end_s)
        return None if rows is None else replace(self, time_s=self.time_s[rows], value=self.value[rows])


Stream: TypeAlias = ImuStream | ScalarStream | VectorStream


def _rows_between(time_s: FloatArray, start_s: float, end_s: float) -> slice | None:
    first, stop = (int(i) for i in np.searchsorted(time_s, [start_s, end_s], side="left"))
    return slice(first, stop) if stop > first else None
