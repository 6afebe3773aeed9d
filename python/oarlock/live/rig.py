"""A rig file: which stream of which source feeds which sensor of which model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.live.outputs.table import Outputs
from oarlock.model.description import ImuDescription
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable

if TYPE_CHECKING:
    from oarlock._core import Model

FORMAT = 1
_KINDS = {
    "encoder": ("scalar", ("value",)),
    "range": ("scalar", ("value",)),
    "position": ("vector", ("position_m",)),
    "orientation": ("orientation", ("quat_wxyz",)),
}
_TOP = ("format", "model", "calibration", "wait_ms", "tie_clocks", "sources", "streams", "outputs")
_OF_STREAM = ("source", "device", "value", "rate_hz", "scale", "offset", "stamp_std_ms", "mag_unit_ut")


@dataclass(frozen=True)
class Source:
    """Where packets come from.

    Args:
        name: in the rig file.
        format: how the bytes are to be read, a name of `oarlock.live.decoders.DECODERS`.
        transport: "udp", "tcp", "serial", "ble", "lsl", "websocket", "mqtt" or "replay".
        options: what else the transport needs, such as `port`.
        decoder: options of the format.
    """

    name: str
    format: str
    transport: str
    options: Mapping[str, object] = field(default_factory=dict)
    decoder: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Feed:
    """What feeds one sensor or input joint of the model.

    Args:
        stream: its name in the model.
        kind: "imu", "scalar", "vector" or "orientation".
        source: name of the source.
        device: which sender of the source: an address, a part of one, or `address/part`; "" for the only one.
        values: names of the values of a `Reading` that it takes: what an inertial unit measures, one for others.
        rate_hz: expected rate; None if unknown.
        scale, offset: scale * value + offset is what the model's sensor reads, rad or m.
        stamp_std_s: standard deviation of its time stamps; None: of a device without a clock, by its transport.
        mag_unit_ut: unit of a magnetometer in arbitrary units, uT; None: learnt from its first readings.
    """

    stream: str
    kind: str
    source: str
    device: str = ""
    values: tuple[str, ...] = ()
    rate_hz: float | None = None
    scale: float = 1.0
    offset: float = 0.0
    stamp_std_s: float | None = None
    mag_unit_ut: float | None = None

    def takes(self, address: str, part: str) -> bool:
        """Whether readings of this sender feed it."""
        names = (address, address.rpartition(":")[0] or address, part)
        whole = tuple(f"{name}/{part}" for name in names[:2])
        return not self.device or self.device.casefold() in {
            name.casefold() for name in (*names, *whole) if name
        }


@dataclass(frozen=True)
class Rig:
    """A rig file, checked against its model.

    Args:
        model: name of a shipped model, or its file.
        calibration: file of the calibration with mounts; None for the model's.
        sources: by name.
        feeds: one for each stream.
        wait_s: how long an estimate waits for readings that come late.
        outputs: where estimates go beside the page.
        ties_clocks: compare the devices' clocks by the movement, and correct what is left between them.
    """

    model: str
    calibration: Path | None
    sources: Mapping[str, Source]
    feeds: tuple[Feed, ...]
    wait_s: float = 0.03
    outputs: Outputs = field(default_factory=Outputs)
    ties_clocks: bool = True

    @classmethod
    def load(cls, file: Path, model: Model | None = None) -> Rig:
        """Read a rig file.

        Args:
            file: its path; paths in it are relative to its folder.
            model: in place of the one that the file names.

        Raises:
            DataError: the file names what the model or a source does not have, or lacks a key.
        """
        return _read(TomlTable.read(file), model)

    @property
    def rate_hz(self) -> float | None:
        """The rate of the estimates: the fastest inertial unit's; None if no rate is known."""
        rates = [f.rate_hz for f in self.feeds if f.rate_hz and f.kind in ("imu", "orientation")]
        others = [f.rate_hz for f in self.feeds if f.rate_hz]
        return max(rates or others, default=None)


def streams_of(model: Model) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Name of each stream that a model can use -> kind of the stream, and the values that it takes by default."""
    told = model.describe()
    found: dict[str, tuple[str, tuple[str, ...]]] = {}
    for sensor in told.sensors:
        if isinstance(sensor, ImuDescription):
            stds = {
                "gyro_rad_s": sensor.gyro_std_rad_s,
                "accel_m_s2": sensor.accel_std_m_s2,
                "mag_ut": sensor.mag_std_ut,
            }
            found[sensor.name] = "imu", tuple(name for name, std in stds.items() if std is not None)
        else:
            found[sensor.name] = _KINDS[sensor.kind]
    return found | {joint.name: _KINDS["encoder"] for joint in told.inputs}


def _read(table: TomlTable, model: Model | None) -> Rig:
    import oarlock

    table.check_format(FORMAT)
    table.check_keys(_TOP)
    folder = table.file.parent
    name = table.string("model")
    place = str(folder / name) if name.endswith(".toml") else name
    calibration = table.string("calibration", "")
    sources = _sources(table.table("sources"))
    streams = streams_of(oarlock.load_model(place) if model is None else model)
    return Rig(
        place,
        folder / calibration if calibration else None,
        sources,
        _feeds(table.table("streams"), sources, streams, name),
        table.number("wait_ms", 30.0) / 1e3,
        outputs=Outputs.read(table.table("outputs", {})),
        ties_clocks=table.boolean("tie_clocks", True),
    )


def _sources(table: TomlTable) -> dict[str, Source]:
    found = {}
    for name in table.values:
        own = table.table(name)
        options = {k: v for k, v in own.values.items() if k not in ("format", "transport", "decoder")}
        decoder = own.table("decoder", {}).values
        found[name] = Source(name, own.string("format"), own.string("transport"), options, decoder)
    return found


def _feeds(
    table: TomlTable,
    sources: Mapping[str, Source],
    streams: Mapping[str, tuple[str, tuple[str, ...]]],
    model: str,
) -> tuple[Feed, ...]:
    found = []
    for stream in table.values:
        if stream not in streams:
            raise DataError(
                f"{table.where(stream)}: the model {model} has no such sensor. {did_you_mean(stream, sorted(streams))}"
            )
        own = table.table(stream)
        own.check_keys(_OF_STREAM)
        source = own.string("source")
        if source not in sources:
            raise DataError(f"{own.where('source')}: is unknown. {did_you_mean(source, sorted(sources))}")
        kind, values = streams[stream]
        if kind != "imu":
            values = (own.string("value", values[0]),)
        rate_hz = _positive(own, "rate_hz", "Hz")
        stamp_std_ms = _positive(own, "stamp_std_ms", "ms")
        found.append(
            Feed(
                stream,
                kind,
                source,
                own.string("device", ""),
                values,
                rate_hz,
                own.number("scale", 1.0),
                own.number("offset", 0.0),
                None if stamp_std_ms is None else stamp_std_ms / 1e3,
                _positive(own, "mag_unit_ut", "uT"),
            )
        )
    return tuple(found)


def _positive(table: TomlTable, key: str, unit: str) -> float | None:
    """A number that may be absent; None without, and for 0."""
    value = table.number(key, 0.0)
    if value < 0.0:
        raise DataError(f"{table.where(key)}: is {value:g}; expected {unit}, above 0")
    return value or None


def rig_document(rig: Rig) -> dict[str, object]:
    """The rig as a TOML document, which `Rig.load` reads back."""
    sources = {}
    for one in rig.sources.values():
        decoder = {"decoder": dict(one.decoder)} if one.decoder else {}
        sources[one.name] = {"format": one.format, "transport": one.transport, **one.options, **decoder}
    plain = Feed("", "", "")
    streams = {}
    for f in rig.feeds:
        keys = {k: getattr(f, k) for k in ("device", "rate_hz", "scale", "offset", "mag_unit_ut")}
        told = {k: v for k, v in keys.items() if v != getattr(plain, k)}
        if f.stamp_std_s is not None:
            told["stamp_std_ms"] = 1e3 * f.stamp_std_s
        value = {} if f.kind == "imu" else {"value": f.values[0]}
        streams[f.stream] = {"source": f.source, **value, **told}
    head: dict[str, object] = {"format": FORMAT, "model": rig.model}
    if rig.calibration is not None:
        head["calibration"] = str(rig.calibration)
    outputs = {"outputs": rig.outputs.document()} if rig.outputs.document() else {}
    if not rig.ties_clocks:
        head["tie_clocks"] = False
    return {**head, "wait_ms": 1e3 * rig.wait_s, "sources": sources, "streams": streams, **outputs}
