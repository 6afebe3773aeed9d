"""Reads one file with a library that a damaged file may crash: `python reader_child.py KIND FILE`.

Used by `oarlock.formats.child_process`. It imports nothing of oarlock, so that it starts quickly. It writes the arrays
to standard output as .npz. If the library refuses the file, it writes the reason to standard error and exits with 1.
"""

import contextlib
import os
import struct
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

_LEAST_BYTES, _BYTES_PER_BYTE = 1 << 30, 64
_LEAST_SECONDS, _BYTES_PER_SECOND = 6, 1 << 20
_COPIES = 4
"""Of the arrays, which the parent makes while it reads them: together they stay within the same memory."""
_BLOCK, _MIPS = 512, 86
_MOST_HEADER = 256 * _BLOCK


def limits_of(file: str | os.PathLike[str]) -> tuple[int, int]:
    """Memory in bytes and processor time in s that the reading of a file may take."""
    size = os.path.getsize(file)
    return _LEAST_BYTES + _BYTES_PER_BYTE * size, _LEAST_SECONDS + size // _BYTES_PER_SECOND


def limit_resources(file: str) -> None:
    """Limit memory and processor time: a damaged byte may request gigabytes or cause an endless loop.

    Windows has no such limits, and macOS none of memory: there the parent's watch alone ends the child.
    """
    try:
        import resource
    except ImportError:
        return
    for limit, most in zip((resource.RLIMIT_AS, resource.RLIMIT_CPU), limits_of(file), strict=True):
        soft, hard = resource.getrlimit(limit)
        bounds = [value for value in (most, soft, hard) if value != resource.RLIM_INFINITY]
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(limit, (min(bounds), hard))


def read_mat(file: str) -> dict[str, Any]:
    """Numbers and texts by name; a field of a structure is called `structure.field`.

    Everything else (cells, arrays of structures, sparse matrices, objects) is left out.
    """
    from scipy.io import loadmat

    try:
        variables = loadmat(file, struct_as_record=False)
    except NotImplementedError as error:
        raise ValueError("a file of version 7.3: save it again in MATLAB with -v7") from error
    variables = {name: value for name, value in variables.items() if not name.startswith("__")}
    return dict(_flat("", variables))


def _flat(path: str, fields: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    from scipy.io.matlab import mat_struct

    for name, value in fields.items():
        only = value.flat[0] if isinstance(value, np.ndarray) and value.size == 1 else None
        if isinstance(only, mat_struct):
            yield from _flat(f"{path}{name}.", {field: getattr(only, field) for field in only._fieldnames})
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biufcU":
            yield f"{path}{name}", value


def read_c3d(file: str) -> dict[str, Any]:
    """Arrays `points` (3, N, T), `residuals` (N, T), `rate_hz`, `first_frame`, `unit` and `labels`."""
    import ezc3d

    content = ezc3d.c3d(file)
    held, announced = content["data"]["points"].shape[2], _announced_frames(file)
    if held < announced:
        raise ValueError(f"its header states {announced} frames, but it contains {held}; was it cut off?")
    point, header = content["parameters"]["POINT"], content["header"]["points"]
    units = point["UNITS"]["value"] if "UNITS" in point else []
    return {
        "points": np.asarray(content["data"]["points"], dtype=np.float64)[:3],
        "residuals": np.asarray(content["data"]["meta_points"]["residuals"], dtype=np.float64)[0],
        "rate_hz": np.float64(header["frame_rate"]),
        "first_frame": np.int64(header["first_frame"]),
        "unit": np.array(str(units[0]) if len(units) else ""),
        "labels": np.array(_texts(point, "LABELS"), dtype=np.str_),
    }


def read_c3d_analogue(file: str) -> dict[str, Any]:
    """Arrays `channels` (N, T), `rate_hz`, `start_s`, `labels` and `units` of the analogue channels."""
    import ezc3d

    content = ezc3d.c3d(file)
    points, analogue = content["header"]["points"], content["header"]["analogs"]
    channels = np.asarray(content["data"]["analogs"], dtype=np.float64)[0]
    rate_hz, frame_hz = float(analogue["frame_rate"]), float(points["frame_rate"])
    held, announced = content["data"]["points"].shape[2], _announced_frames(file)
    if rate_hz > 0.0 and frame_hz > 0.0:
        held = max(held, round(channels.shape[1] * frame_hz / rate_hz))
    if held < announced:
        raise ValueError(f"its header states {announced} frames, but it contains {held}; was it cut off?")
    group = content["parameters"]["ANALOG"]
    return {
        "channels": channels,
        "rate_hz": np.float64(rate_hz),
        "start_s": np.float64(points["first_frame"] / frame_hz if frame_hz > 0.0 else 0.0),
        "labels": np.array(_texts(group, "LABELS"), dtype=np.str_),
        "units": np.array(_texts(group, "UNITS"), dtype=np.str_),
    }


def _announced_frames(file: str) -> int:
    """Number of frames in the header of the file. ezc3d changes the header to match the data."""
    with open(file, "rb") as stream:
        raw = stream.read(_MOST_HEADER)
    processor = raw[(raw[0] - 1) * _BLOCK + 3]
    first, last = struct.unpack_from(">2H" if processor == _MIPS else "<2H", raw, 6)
    return int(last) - int(first) + 1


def _texts(group: Any, name: str) -> list[str]:
    """All texts: a C3D parameter has at most 255, so larger sets continue in LABELS2, LABELS3, ..."""
    found: list[str] = []
    for number in range(1, 100):
        key = name if number == 1 else f"{name}{number}"
        if key not in group:
            break
        found += [str(text).strip() for text in group[key]["value"]]
    return found


def read_hdf5(file: str) -> dict[str, Any]:
    """Numbers by path, and attributes that are numbers or texts as `path@name`; nothing of other files is read."""
    import h5py

    found: dict[str, Any] = {}

    def visit(path: str, node: Any) -> None:
        for name, value in node.attrs.items():
            if isinstance(value, bytes):
                value = value.decode("utf-8", "replace")
            if isinstance(value, str | np.number):
                found[f"{path}@{name}"] = np.array(str(value))
        if (
            isinstance(node, h5py.Dataset)
            and node.dtype.kind in "biuf"
            and not (node.external or node.is_virtual)
        ):
            found[path] = node[()]

    with h5py.File(file, "r") as content:
        visit("", content)
        content.visititems(visit)
    return found


def read_mcap(file: str) -> dict[str, Any]:
    """Messages of inertial units and magnetometers by channel: `N.topic`, `N.schema`, `N.log_ns`, `N.sizes`, `N.data`.

    `others` has topic and schema of every other channel.
    """
    from mcap.reader import make_reader

    told: dict[int, tuple[str, str]] = {}
    stamps: dict[int, list[int]] = {}
    bodies: dict[int, list[bytes]] = {}
    with open(file, "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            name = "" if schema is None else schema.name
            told[channel.id] = (channel.topic, f"{name} {channel.message_encoding}")
            if told[channel.id][1] in _MCAP_SCHEMAS:
                stamps.setdefault(channel.id, []).append(message.log_time)
                bodies.setdefault(channel.id, []).append(message.data)
    found: dict[str, Any] = {
        "others": np.array(
            [f"{t} ({s})" for number, (t, s) in told.items() if number not in bodies], dtype=np.str_
        )
    }
    for place, number in enumerate(bodies):
        found[f"{place}.topic"], found[f"{place}.schema"] = (np.array(text) for text in told[number])
        found[f"{place}.log_ns"] = np.array(stamps[number], dtype=np.uint64)
        found[f"{place}.sizes"] = np.array([len(body) for body in bodies[number]], dtype=np.int64)
        found[f"{place}.data"] = np.frombuffer(b"".join(bodies[number]), dtype=np.uint8)
    return found


_MCAP_SCHEMAS = ("sensor_msgs/msg/Imu cdr", "sensor_msgs/msg/MagneticField cdr")
_READERS = {
    "c3d": read_c3d,
    "c3d_analogue": read_c3d_analogue,
    "hdf5": read_hdf5,
    "mat": read_mat,
    "mcap": read_mcap,
}


def main(kind: str, file: str) -> int:
    """Read one file; the exit status."""
    try:
        limit_resources(file)
        arrays = _READERS[kind](file)
        size, most = sum(np.asarray(one).nbytes for one in arrays.values()), limits_of(file)[0] // _COPIES
        if size > most:
            raise ValueError(
                f"it unpacks to {size / 1e6:,.0f} MB, more than the {most / 1e6:,.0f} MB of any recording"
            )
        np.savez(sys.stdout.buffer, **arrays)
    except Exception as error:  # the library may raise any exception
        print(str(error) or type(error).__name__, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
