"""Reads the folder of CSV files that x-io's software writes for one x-IMU3."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np

from oarlock.formats.columns import read_columns
from oarlock.formats.devices.ximu3_unit import COLUMNS, TIME, MessageTable, Ximu3Unit
from oarlock.storage.delimited import ColumnLayout, Dialect
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import read_text

COMMANDS = "Command.json"
_LARGEST_US = 2.0**53
# The software names a folder "NAME SERIAL (INTERFACE)" as soon as the unit has answered to its ping.
_FOLDER = re.compile(r"(?P<name>.+?)(?: -)? (?P<serial>[0-9A-F]{8}|[0-9A-F]{4}(?:-[0-9A-F]{4}){3}) \(.+\)")


def folder_unit(folder: Path) -> Ximu3Unit:
    """The unit of a folder with Inertial.csv, Magnetometer.csv or Quaternion.csv.

    Raises:
        DataError: a file is damaged; names the file and the line.
    """
    commands = _commands(folder / COMMANDS)
    named = _FOLDER.fullmatch(folder.name)
    ping = commands.get("ping")
    told = ping if isinstance(ping, dict) else {}
    label = str(told.get("name") or (named["name"] if named else folder.name))
    serial = str(told.get("sn") or (named["serial"] if named else ""))
    messages = {
        kind: _messages(folder / f"{kind}.csv", columns)
        for kind, columns in COLUMNS.items()
        if (folder / f"{kind}.csv").is_file()
    }
    return Ximu3Unit(str(folder), label, serial, messages, commands)


def _messages(file: Path, columns: tuple[str, ...]) -> MessageTable:
    if file.stat().st_size == 0:
        raise DataError(f"{file}: is empty; the header {TIME},{','.join(columns)} is missing")
    rows = read_columns(ColumnLayout.of(file, Dialect()), (TIME, *columns))
    time_us = rows[:, 0]
    bad = np.flatnonzero(~(np.abs(time_us) < _LARGEST_US) | (time_us != np.round(time_us)))
    if bad.size:
        raise DataError(
            f'{file}, column "{TIME}": is {time_us[bad[0]]:g} in row {bad[0] + 1} after the header; '
            "expected whole microseconds"
        )
    return MessageTable(time_us.astype(np.int64), rows[:, 1:])


def _commands(file: Path) -> dict[str, object]:
    """What the unit answered, by key, the last one of each; the file is a JSON list of objects with one key."""
    if not file.is_file():
        return {}
    try:
        found = json.loads(read_text(file, "utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise DataError(f"{file}: is not JSON ({error})") from error
    if not isinstance(found, list) or not all(isinstance(answer, dict) for answer in found):
        raise DataError(f'{file}: expected a list of objects such as [{{"ping": ...}}, {{"time": ...}}]')
    return {key: value for answer in found for key, value in answer.items()}
