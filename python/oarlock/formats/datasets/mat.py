"""Reads matrices and structures of MATLAB files (version 4 to 7), for the readers of .mat formats."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oarlock.formats.child_process import arrays_of
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

Variables = Mapping[str, NDArray[Any]]
"""Numbers and texts by name; a field of a structure is called `structure.field`."""


def read_mat(file: Path) -> Variables:
    """The variables of a file that are numbers or text, also those inside structures.

    Raises:
        DataError: The file cannot be read, is no MATLAB file, is damaged, or is one of version 7.3 (HDF5).
    """
    return arrays_of("mat", file)


def variable(variables: Variables, name: str, file: Path) -> NDArray[Any]:
    """One variable of a file, or one field of a structure.

    Raises:
        DataError: There is none of this name.
    """
    if name not in variables:
        hint = did_you_mean(name, list(variables))
        raise DataError(f'{file}: has no variable "{name}" of numbers or text. {hint}')
    return variables[name]


def structure(variables: Variables, name: str, file: Path) -> Variables:
    """The fields of a structure, by the names that they have in the file.

    Raises:
        DataError: There is no variable of this name, or it is not a single structure.
    """
    fields = {key: value for key, value in variables.items() if key.startswith(f"{name}.")}
    if not fields:
        variable(variables, name, file)
        raise DataError(f'{file}: "{name}" is not a structure')
    return fields


def matrix(variables: Variables, name: str, columns: int, file: Path) -> Floats:
    """A matrix of (T, columns).

    Raises:
        DataError: There is no variable of this name, or it is not a real matrix of this width.
    """
    return real_array(variable(variables, name, file), (None, columns), f"{file}, {name}")


def number(variables: Variables, name: str, file: Path) -> float:
    """A single real number.

    Raises:
        DataError: There is no variable of this name, or it is not one finite number.
    """
    value = real_array(variable(variables, name, file), (1, 1), f"{file}, {name}")
    if not np.isfinite(value).all():
        raise DataError(f"{file}, {name}: is {value.item()}, expected a finite number")
    return float(value.item())


def sampling_rate(variables: Variables, name: str, file: Path) -> float:
    """A sampling rate in Hz.

    Raises:
        DataError: As `number`, or the rate is not positive.
    """
    rate_hz = number(variables, name, file)
    if rate_hz <= 0.0:
        raise DataError(f"{file}, {name}: is {rate_hz:g} Hz, expected a positive sampling rate")
    return rate_hz


def same_length(first: Floats, other: Floats, names: tuple[str, str], file: Path) -> None:
    """Refuse two matrices of one file that do not have one row for each sample.

    Raises:
        DataError: They differ in length.
    """
    if len(first) != len(other):
        raise DataError(f"{file}: {names[0]} has {len(first)} rows, but {names[1]} has {len(other)}")
