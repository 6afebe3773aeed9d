"""Columns as tables of pandas, polars and xarray, which are optional. Used by tracks, streams and evaluations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from oarlock.storage.extras import optional

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import xarray as xr

Columns = Mapping[str, Any]


def pandas_table(columns: Columns) -> pd.DataFrame:
    """A pandas DataFrame.

    Raises:
        DataError: pandas is not installed.
    """
    return optional("pandas", "dataframe", "to_pandas").DataFrame(dict(columns))


def polars_table(columns: Columns) -> pl.DataFrame:
    """A polars DataFrame. Missing numbers are NaN, as in the arrays, not null.

    Raises:
        DataError: polars is not installed.
    """
    table: pl.DataFrame = optional("polars", "polars", "to_polars").DataFrame(dict(columns))
    return table


def xarray_dataset(columns: Columns, unit_of: Callable[[str], str]) -> xr.Dataset:
    """An xarray Dataset over the coordinate `time_s`; each variable has its unit as attribute `units`.

    Raises:
        DataError: xarray is not installed.
    """
    xarray = optional("xarray", "xarray", "to_xarray")
    series = {name: ("time_s", values, {"units": unit_of(name)}) for name, values in columns.items()}
    time_s = series.pop("time_s")
    dataset: xr.Dataset = xarray.Dataset(series, coords={"time_s": time_s})
    return dataset


def columns_of_rows(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Rows as columns, in the order of the first row's keys; None where a row lacks a key."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in names}
