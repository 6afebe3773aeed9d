"""What a Shimmer3 sends in a data packet, by its inquiry response, and its calibration, for its decoder.

Sources: the channels' numbers, widths and byte orders as pyshimmer documents them; calibration after F. Ferraris,
U. Grimaldi and M. Parvis, "Procedure for effortless in-field calibration of three-axial rate gyro and
accelerometers", Sensors and Materials 7 (1995): c = R^-1 K^-1 (u - b). The order of the sensors in the calibration
response (low-noise accelerometer, gyroscope, magnetometer, wide-range accelerometer) could not be verified against
the maker's document.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from oarlock.live.decoders.quantities import radians
from oarlock.live.reading import Value
from oarlock.storage.arrays import Floats


@dataclass(frozen=True)
class _ChannelFormat:
    name: str
    width: int = 2
    order: Literal["little", "big"] = "little"
    signed: bool = True


def _triad(first: int, name: str, order: Literal["little", "big"] = "little") -> dict[int, _ChannelFormat]:
    return {first + k: _ChannelFormat(f"{name}_{axis}", order=order) for k, axis in enumerate("xyz")}


_CHANNELS: Mapping[int, _ChannelFormat] = MappingProxyType(
    {
        **_triad(0x00, "accel_ln"),
        0x03: _ChannelFormat("battery"),
        **_triad(0x04, "accel_wr"),
        **_triad(0x07, "mag"),
        **_triad(0x0A, "gyro", "big"),
        **{
            0x0D + k: _ChannelFormat(f"adc_{n}", signed=False)
            for k, n in enumerate((7, 6, 15, 1, 12, 13, 14))
        },
        0x1A: _ChannelFormat("temperature", 2, "big", signed=False),
        0x1B: _ChannelFormat("pressure", 3, "big", signed=False),
        0x1C: _ChannelFormat("gsr", signed=False),
        0x1D: _ChannelFormat("exg1_status", 1, signed=False),
        0x1E: _ChannelFormat("exg1_ch1", 3, "big"),
        0x1F: _ChannelFormat("exg1_ch2", 3, "big"),
        0x20: _ChannelFormat("exg2_status", 1, signed=False),
        0x21: _ChannelFormat("exg2_ch1", 3, "big"),
        0x22: _ChannelFormat("exg2_ch2", 3, "big"),
        0x23: _ChannelFormat("exg1_ch1", 2, "big"),
        0x24: _ChannelFormat("exg1_ch2", 2, "big"),
        0x25: _ChannelFormat("exg2_ch1", 2, "big"),
        0x26: _ChannelFormat("exg2_ch2", 2, "big"),
        0x27: _ChannelFormat("strain_high", signed=False),
        0x28: _ChannelFormat("strain_low", signed=False),
    }
)
_SENSORS = ("accel_ln", "gyro", "mag", "accel_wr")
"""In the order of the calibration response."""
_CALIBRATION = struct.Struct(">6h9b")
CALIBRATION_BYTES = len(_SENSORS) * _CALIBRATION.size
_INQUIRY = struct.Struct("<HIBB")
INQUIRY_BYTES = _INQUIRY.size


@dataclass(frozen=True)
class PacketLayout:
    """What follows the time stamp of a data packet.

    Args:
        period: clock ticks from sample to sample.
        channels: in their order.
    """

    period: int
    channels: tuple[_ChannelFormat, ...]

    @property
    def size(self) -> int:
        """Bytes of the channels of one packet."""
        return sum(channel.width for channel in self.channels)

    def counts(self, data: bytes) -> dict[str, int]:
        """Channel -> what the unit sent."""
        found, at = {}, 0
        for one in self.channels:
            found[one.name] = int.from_bytes(data[at : at + one.width], one.order, signed=one.signed)
            at += one.width
        return found


def channel_count(response: bytes) -> int:
    """How many channels follow the head of an inquiry response."""
    return int(_INQUIRY.unpack_from(response)[2])


def layout_of(response: bytes) -> PacketLayout | None:
    """The layout by an inquiry response without its first byte; None if it is none, or has unknown channels."""
    period, _, count, buffered = _INQUIRY.unpack_from(response)
    numbers = response[INQUIRY_BYTES : INQUIRY_BYTES + count]
    if not period or not count or buffered != 1 or any(number not in _CHANNELS for number in numbers):
        return None
    return PacketLayout(period, tuple(_CHANNELS[number] for number in numbers))


@dataclass(frozen=True)
class ChannelCalibration:
    """Offset b in counts, (3,), and (3, 3) R^-1 K^-1, to deg/s, m/s2 or local flux."""

    offset: Floats
    matrix: Floats


def calibrations_of(response: bytes) -> dict[str, ChannelCalibration]:
    """Sensor -> its calibration, by a calibration response without its first byte; some may have none."""
    found = {}
    for name, numbers in zip(_SENSORS, _CALIBRATION.iter_unpack(response), strict=True):
        if min(numbers[3:6]) <= 0:
            continue
        sensitivity = np.array(numbers[3:6]) / (100.0 if name == "gyro" else 1.0)
        alignment = np.array(numbers[6:]).reshape(3, 3) / 100.0
        # Rows are directions: memory that was never written has others.
        if 0.5 < abs(np.linalg.det(alignment)) < 1.5:
            matrix = np.linalg.inv(alignment) / sensitivity
            found[name] = ChannelCalibration(np.array(numbers[:3], float), matrix)
    return found


def values_of(
    counts: Mapping[str, int], calibrations: Mapping[str, ChannelCalibration], accel: str
) -> dict[str, Value]:
    """Quantities of the sensors that have a calibration, `NAME_counts` of all others.

    Args:
        counts: as `PacketLayout.counts`.
        calibrations: as `calibrations_of`.
        accel: which accelerometer is `accel_m_s2`: "LN" (low noise) or "WR" (wide range); "" for LN where there is one.
    """
    chosen = f"accel_{accel.lower()}" if accel else "accel_ln" if "accel_ln_x" in counts else "accel_wr"
    rest = dict(counts)
    values: dict[str, Value] = {}
    for name in _SENSORS:
        axes = [f"{name}_{axis}" for axis in "xyz"]
        if not all(axis in rest for axis in axes):
            continue
        raw = tuple(float(rest.pop(axis)) for axis in axes)
        if name in calibrations:
            one = calibrations[name]
            measured = tuple((one.matrix @ (np.array(raw) - one.offset)).tolist())
            values |= _quantity(name, measured, name == chosen)
        else:
            values[f"{name}_counts"] = raw
    return values | {f"{name}_counts": float(count) for name, count in rest.items()}


def _quantity(name: str, measured: tuple[float, ...], chosen: bool) -> dict[str, Value]:
    if name == "gyro":
        return {"gyro_rad_s": radians(measured)}
    if name == "mag":
        return {"mag_arbitrary": measured}
    return {"accel_m_s2" if chosen else f"{name}_m_s2": measured}
