"""`Database`: the tables of a season as views of DuckDB, in memory, with the ready questions as macros."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.rowing.crew.matching import delays
from oarlock.rowing.crew.seats import seat_place
from oarlock.season.athletes import check_scope
from oarlock.season.records import Entry, RunRecord
from oarlock.season.store import Season, in_threads, not_in_season
from oarlock.season.tables import (
    KEYS,
    Catalogue,
    athlete_rows,
    recording_rows,
    run_rows,
    update_tables,
)
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    import pyarrow as pa

_SETTINGS: dict[str, Any] = {
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "allow_community_extensions": False,
    "python_enable_replacements": False,
    "temp_directory": "",
}
_SIDED = " right minus left"
_MOST_DF = 300
_UNIT = re.compile(r"_(rad|deg|per_min|m_s2|m_s|rad_s|m2|s|m|w|n|j)$")
_TO = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*(?:-|to|\.\.)\s*(\d+(?:\.\d+)?)\s*$")


@dataclass(frozen=True)
class Selection:
    """Which rows of a season are asked; None does not restrict.

    Args:
        athlete: pseudonym.
        boat: as in `session.toml`.
        comparable: class of runs.
        since: first day, UTC.
        until: last day, UTC.
        scope: only athletes who consent to this use: `coaching`, `research` or `sharing`.
    """

    athlete: str | None = None
    boat: str | None = None
    comparable: str | None = None
    since: datetime.date | None = None
    until: datetime.date | None = None
    scope: str | None = None

    def selects(self, entry: Entry, run: RunRecord | None) -> bool:
        """Whether a recording with its current run is asked of."""
        day = None if entry.start is None else entry.start.date()
        return (
            self.boat in (None, entry.session.get("boat"))
            and self.comparable in (None, None if run is None else run.comparable)
            and (self.since is None or (day is not None and self.since <= day))
            and (self.until is None or (day is not None and day <= self.until))
        )

    def __str__(self) -> str:
        named = {"boat": self.boat, "class": self.comparable, "since": self.since, "until": self.until}
        parts = [self.athlete, *(f"{name} {value}" for name, value in named.items() if value is not None)]
        return ", ".join(part for part in parts if part) or "the season"


@dataclass(frozen=True)
class Rates:
    """Stroke rates, 1/min, both included; None does not restrict."""

    low: float | None = None
    high: float | None = None

    @classmethod
    def parsed(cls, text: str | None) -> Rates:
        """Rates of a text such as "20-24"."""
        if text is None:
            return cls()
        found = _TO.match(text)
        if found is None or float(found[1]) >= float(found[2]):
            raise DataError(f'"{text}" is no range of stroke rates; expected one such as 20-24')
        return cls(float(found[1]), float(found[2]))


def metric_named(text: str, metrics: Sequence[str]) -> str:
    """The metric of a name, which may lack its unit: `Catch angle` and `catch_angle_rad` are the same."""
    asked = re.sub(r"[\s\-]+", "_", text.strip()).casefold()
    if asked in metrics:
        return asked
    found = [name for name in metrics if _UNIT.sub("", name) == _UNIT.sub("", asked)]
    if len(found) == 1:
        return found[0]
    if found:
        raise DataError(f'"{text}" may be {" or ".join(found)}; give one of them')
    raise DataError(
        f'"{text}" is no metric of this season. {did_you_mean(asked, (_UNIT.sub("", name) for name in metrics))}'
    )


class Database:
    """The tables of a season, or of a part of it. Close it, or use it in a `with`.

    Args:
        season: which.
        selection: which rows.
        tables: what is in the tables; None brings those of the season up to date first.

    Raises:
        DataError: DuckDB is not installed, the selection names somebody or something that is not there, or a table
            is damaged.
    """

    def __init__(
        self, season: Season, selection: Selection | None = None, tables: Catalogue | None = None
    ) -> None:
        self.season, self.selection = season, selection or Selection()
        self._connection = _connected(season.place.address)
        try:
            self._open(update_tables(season, self.selection.athlete) if tables is None else tables)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Database:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End it."""
        self._connection.close()

    def table(self, sql: str) -> pa.Table:
        """The answer to one statement that only reads.

        Raises:
            DataError: the statement is wrong, would change something, or reads what is no table of the season.
        """
        import duckdb

        kinds = (duckdb.StatementType.SELECT, duckdb.StatementType.EXPLAIN)
        try:
            statements = self._connection.extract_statements(sql)
            if len(statements) != 1 or statements[0].type not in kinds:
                raise DataError(
                    "a question is one statement that reads, such as SELECT, DESCRIBE or SUMMARIZE; got "
                    + (", then ".join(one.type.name for one in statements) or "none")
                )
            return self._connection.sql(sql).to_arrow_table()
        except duckdb.Error as error:
            raise DataError(f"the question cannot be answered: {error}{self._advice(error)}") from None

    def _advice(self, error: BaseException) -> str:
        """What to do where DuckDB could not read a file; empty for other errors."""
        import duckdb

        own = (duckdb.ParserException, duckdb.BinderException, duckdb.CatalogException)
        if isinstance(error, (*own, duckdb.PermissionException)):
            return ""
        return f". If a table is damaged: `oarlock season check {self.season.place.address} --repair`"

    def metric(self, text: str) -> str:
        """The column of a metric's name.

        Raises:
            DataError: there is none.
        """
        if not self.metrics:
            raise DataError(
                f"{self.season.place.address}: has no strokes yet; compute them: `oarlock season run`"
            )
        return metric_named(text, self.metrics)

    def classes(self) -> dict[str, tuple[str, int]]:
        """Engine and number of recordings of each class of runs among the strokes, most recordings first."""
        rows = self.table("FROM classes").to_pylist()
        return {row["comparable"]: (row["engine"], row["recordings"]) for row in rows}

    def _open(self, found: Catalogue) -> None:
        here = in_threads(self._path, [one.file for one in found.of])
        # An athlete whose table is gone was erased meanwhile.
        found = Catalogue([one for one, path in zip(found.of, here, strict=True) if path is not None])
        self._check_named(found)
        asked = self._selected(found)
        self._run("SET TimeZone = 'UTC'")
        tables = {"athletes": athlete_rows, "recordings": recording_rows, "runs": run_rows}
        for name, rows in tables.items():
            self._create(name, rows(asked))
        paths = [_text(str(path)) for path in here if path is not None]
        self._strokes(f"read_parquet([{', '.join(paths)}], union_by_name = true, hive_partitioning = false)")
        self._run(f"SET allowed_paths = [{', '.join(paths)}]")
        self._run("SET enable_external_access = false")
        self._run("SET lock_configuration = true")

    def _selected(self, found: Catalogue) -> Catalogue:
        """What is asked of: athletes who consent, recordings, and the runs over these."""
        asked, selected = self.selection, []
        for one in found.of:
            if asked.scope is not None and not one.athlete.allows(asked.scope):
                continue
            runs = one.current()
            entries = {name: it for name, it in one.entries.items() if asked.selects(it, runs.get(name))}
            records = [record for record in one.records if record.recording in entries]
            selected.append(replace(one, entries=entries, records=records))
        return Catalogue(selected)

    def _create(self, name: str, rows: pa.Table) -> None:
        self._connection.register("rows", rows)
        self._run(f"CREATE TABLE {name} AS FROM rows")
        self._connection.unregister("rows")

    def _path(self, file: str) -> Path | None:
        try:
            return self.season.place.on_disk(file)
        except FileNotFoundError:
            return None

    def _strokes(self, files_: str) -> None:
        """The view of strokes, and all questions."""
        from scipy.special import stdtrit

        # A macro is bound when it is made; on an empty table that needs no file. The view replaces it.
        is_empty = files_.startswith("read_parquet([]")
        if is_empty:
            self._create("strokes", KEYS.empty_table())
        else:
            self._run(f"CREATE TABLE strokes AS FROM {files_} LIMIT 0")
        columns = [row[0] for row in self._connection.execute("DESCRIBE strokes").fetchall()]
        self.metrics = [name for name in columns if not name.endswith("_std") and name not in KEYS.names]
        self._run(_stroke_values(set(columns), self.metrics))
        for name, share in (("t95", 0.975), ("t999", 0.9995)):  # quantiles of Student's t
            quantiles = [round(float(one), 6) for one in stdtrit(np.arange(1, _MOST_DF + 1), share)]
            case = f"CASE WHEN df >= 1 THEN {quantiles}[least(df, {_MOST_DF})::INTEGER] END"
            self._run(f"CREATE MACRO {name}(df) AS {case}")
        add_crew_functions(self._connection)
        self._run(files("oarlock.season").joinpath("views.sql").read_text(encoding="utf-8"))
        if not is_empty:
            self._run("DROP TABLE strokes")
            only = "" if self.selection == Selection() else "SEMI JOIN recordings USING (recording)"
            self._run(f"CREATE VIEW strokes AS FROM {files_} {only}")

    def _check_named(self, found: Catalogue) -> None:
        asked = self.selection
        if asked.scope is not None:
            check_scope(asked.scope)
        if asked.athlete is not None and not found.of:
            raise not_in_season("athlete", asked.athlete, self.season.athletes())
        if asked.athlete is not None and asked.scope and not found.of[0].athlete.allows(asked.scope):
            raise DataError(f"{asked.athlete} has not consented to {asked.scope}")
        boats = {entry.session["boat"] for entry in found.entries.values() if entry.session.get("boat")}
        classes = {record.comparable for record in found.records}
        for what, name, known in (("boat", asked.boat, boats), ("class of runs", asked.comparable, classes)):
            if name is not None and name not in known:
                raise not_in_season(what, name, known)

    def _run(self, sql: str) -> None:
        import duckdb

        try:
            self._connection.execute(sql)
        except duckdb.Error as error:
            raise DataError(f"{self.season.place.address}: {error}{self._advice(error)}") from error


def _connected(address: str) -> Any:
    try:
        import duckdb
    except ImportError:
        raise DataError(
            f'{address}: questions need one more package: pip install "oarlock[season]"'
        ) from None
    return duckdb.connect(":memory:", config=_SETTINGS)


def _stroke_values(columns: set[str], metrics: Sequence[str]) -> str:
    """The macro that gives one metric of each stroke; DuckDB reads just the columns of the metric asked for."""
    values, stds = {}, {}
    for name in metrics:
        values[name], stds[name] = f'"{name}"', f'"{name}_std"' if f"{name}_std" in columns else "NULL"
        right, left = f"r_{name}", f"l_{name}"
        if {right, left} <= columns:
            values[name + _SIDED] = f'"{right}" - "{left}"'
            known = {f"{right}_std", f"{left}_std"} <= columns
            stds[name + _SIDED] = (
                f'sqrt("{right}_std" * "{right}_std" + "{left}_std" * "{left}_std")' if known else "NULL"
            )
    rate = "rate_per_min" if "rate_per_min" in columns else "NULL::FLOAT"
    counted = "coalesce(in_averages, 1) > 0" if "in_averages" in columns else "true"
    return (
        "CREATE MACRO stroke_values(metric, rate_from := NULL, rate_to := NULL) AS TABLE "
        f"SELECT recording, comparable, athlete, boat, seat, rig, started, stroke, {rate}::DOUBLE AS rate, "
        f"({_choice(values)})::DOUBLE AS value, ({_choice(stds)})::DOUBLE AS std FROM strokes WHERE {counted} "
        f"AND (rate_from IS NULL OR {rate} >= rate_from) AND (rate_to IS NULL OR {rate} <= rate_to)"
    )


def _choice(by_name: dict[str, str]) -> str:
    cases = " ".join(f"WHEN {_text(name)} THEN {value}" for name, value in by_name.items())
    return f"CASE metric {cases} END" if by_name else "NULL"


def _text(text: str) -> str:
    """A text of SQL."""
    return "'" + text.replace("'", "''") + "'"


def add_crew_functions(connection: Any) -> None:
    """Registers `seat_place(seat)` and `delays(leader, own, after_s)` with DuckDB."""
    kept = {"null_handling": "special"}
    connection.create_function("seat_place", _place, ["VARCHAR"], "DOUBLE", **kept)
    connection.create_function("delays", _delays, ["DOUBLE[]", "DOUBLE[]", "DOUBLE"], "DOUBLE[]")


def _place(seat: str | None) -> float | None:
    """Counted from the bow; None for what names no seat."""
    with suppress(DataError):
        return seat_place(seat) if seat else None
    return None


def _delays(leader_s: list[float], own_s: list[float], after_s: float) -> list[float | None]:
    """How much later than the leader's each catch is, s; None without a partner.

    Times are of the own recording each, which starts `after_s` after the leader's.
    """
    late = delays(np.asarray(leader_s), np.asarray(own_s) + after_s)
    return [None if np.isnan(one) else float(one) for one in late]
