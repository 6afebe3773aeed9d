"""MATLAB files (version 5 to 7): matrices and structures by name, with errors that name file and variable."""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import mat_struct

from oarlock.formats.mat_layout import sound_variables
from oarlock.storage.array_gate import FloatArray, real_array
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

Variables = Mapping[str, object]


def read_mat(file: Path) -> Variables:
    """The variables of a file that are numbers, text, cells or structures.

    Raises:
        DataError: The file cannot be read, is no MATLAB file, is damaged, or is one of version 7.3 (HDF5).
    """
    try:
        raw = file.read_bytes()
    except (OSError, ValueError) as error:
        raise DataError(f"{file}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
    names = sound_variables(raw, file)
    try:
        found = loadmat(BytesIO(raw), struct_as_record=False, variable_names=names)
    except Exception as error:  # of a damaged file scipy raises whatever its parts do
        raise DataError(f"{file}: is no MATLAB file, or is damaged ({error})") from error
    return {name: found[name] for name in names if name in found}


def variable(variables: Variables, name: str, file: Path) -> object:
    """One variable of a file, or one field of a structure.

    Raises:
        DataError: There is none of this name.
    """
    if name not in variables:
        hint = did_you_mean(name, list(variables))
        raise DataError(f'{file}: has no variable "{name}" of numbers, text, cells or structures. {hint}')
    return variables[name]


def structure(variables: Variables, name: str, file: Path) -> Variables:
    """The fields of a structure.

    Raises:
        DataError: There is no variable of this name, or it is not a single structure.
    """
    value = variable(variables, name, file)
    if isinstance(value, np.ndarray) and value.size == 1 and isinstance(value.flat[0], mat_struct):
        only = value.flat[0]
        return {f"{name}.{field}": getattr(only, field) for field in only._fieldnames}
    raise DataError(f'{file}: "{name}" is not a structure')


def matrix(variables: Variables, name: str, columns: int, file: Path) -> FloatArray:
    """A matrix of (T, columns).

    Raises:
        DataError: There is no variable of this name, or it is not a real matrix of this width.
    """
    return real_array(variable(variables, name, file), (None, columns), f"{file}, {name}")  # type: ignore[arg-type]


def number(variables: Variables, name: str, file: Path) -> float:
    """A single real number.

    Raises:
        DataError: There is no variable of this name, or it is not one finite number.
    """
    value = real_array(variable(variables, name, file), (1, 1), f"{file}, {name}")  # type: ignore[arg-type]
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


def same_length(first: FloatArray, other: FloatArray, names: tuple[str, str], file: Path) -> None:
    """Refuse two matrices of one file that do not have one row for each sample.

    Raises:
        DataError: They differ in length.
    """
    if len(first) != len(other):
        raise DataError(f"{file}: {names[0]} has {len(first)} rows, but {names[1]} has {len(other)}")
