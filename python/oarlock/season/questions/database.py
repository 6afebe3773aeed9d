"""`Database`: a season's tables as views of DuckDB, in memory, with the ready questions as macros."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from oarlock.evaluation.distributions import student_quantile
from oarlock.season.athletes import check_scope
from oarlock.season.compact import Current, compact
from oarlock.season.questions.crew_functions import add_crew_functions
from oarlock.season.questions.selection import Selection, metric_named, metrics_among
from oarlock.season.schema import KEYS
from oarlock.season.store import Season, not_in_season
from oarlock.storage.errors import DataError

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


class Database:
    """The tables of a season, or of a part of it. Close it, or use it in a `with`.

    Args:
        season: which.
        selection: which rows.
        current: the tables; None brings those of the season up to date first.

    Raises:
        DataError: DuckDB is not installed, the selection names somebody or something that is not there, or a table
            is damaged.
    """

    def __init__(
        self, season: Season, selection: Selection | None = None, current: Current | None = None
    ) -> None:
        self.season, self.selection = season, selection or Selection()
        self._connection = _connected(season.place.address)
        try:
            self._open(compact(season) if current is None else current)
        except BaseException as error:
            self.close()
            if _is_of_files(error):
                address = season.place.address
                raise DataError(
                    f"{address}: a table of the season cannot be read ({str(error).splitlines()[0]}). "
                    f"Make it again: `oarlock season check {address} --repair`"
                ) from None
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
            raise DataError(f"the question cannot be answered: {error}") from None

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

    def _open(self, current: Current) -> None:
        self._run("SET TimeZone = 'UTC'")
        place, names = self.season.place, current.files
        recordings, runs, athletes = (
            place.on_disk([names[table]])[0] for table in ("recordings", "runs", "athletes")
        )
        strokes = place.on_disk([names[table] for table in sorted(names) if table.startswith("strokes/")])
        self._run(f"CREATE TABLE athletes AS FROM {_read([athletes])} WHERE {self._consent()}")
        self._check_named(_read([recordings]), _read([runs]))
        self._run(
            "CREATE TABLE recordings AS SELECT r.*, u.comparable, u.engine "
            f"FROM {_read([recordings])} r LEFT JOIN {_read([runs])} u USING (recording, run) WHERE {self._rows()}"
        )
        self._run(
            f"CREATE TABLE runs AS FROM {_read([runs])} WHERE recording IN (SELECT recording FROM recordings)"
        )
        self._strokes(strokes)
        paths = ", ".join(_text(str(file)) for file in strokes)
        self._run(f"SET allowed_paths = [{paths}]")
        self._run("SET enable_external_access = false")
        self._run("SET lock_configuration = true")

    def _strokes(self, paths: Sequence[Path]) -> None:
        """The view of strokes, and all questions."""
        kinds = ", ".join(f"{field.name} {_KINDS[str(field.type)]}" for field in KEYS)
        rows = f"AS FROM {_read(paths)} LIMIT 0" if paths else f"({kinds})"
        # A macro is bound when it is made; on an empty table that needs no file. The view replaces it.
        self._run(f"CREATE TABLE strokes {rows}")
        columns = self._values("DESCRIBE strokes")
        self.metrics = metrics_among(name for name in columns if name not in KEYS.names)
        self._run(_stroke_values(set(columns), self.metrics))
        for name, share in (("t95", 0.975), ("t999", 0.9995)):
            quantile = f"{_quantiles(share)}[least(df, {_MOST_DF})::INTEGER]"
            self._run(f"CREATE MACRO {name}(df) AS CASE WHEN df >= 1 THEN {quantile} END")
        add_crew_functions(self._connection)
        self._run(files("oarlock.season.questions").joinpath("views.sql").read_text(encoding="utf-8"))
        if paths:
            self._run("DROP TABLE strokes")
            self._run(f"CREATE VIEW strokes AS FROM {_read(paths)} WHERE {self._rows()}")

    def _consent(self) -> str:
        scope = self.selection.scope
        if scope is None:
            return "true"
        check_scope(scope)
        return f"list_contains(string_split(consent, ', '), {_text(scope)})"

    def _check_named(self, recordings: str, runs: str) -> None:
        asked = self.selection
        consents = self._values("SELECT athlete FROM athletes")
        if asked.athlete not in consents and asked.athlete in self.season.athletes():
            raise DataError(f"{asked.athlete} has not consented to {asked.scope}")
        for what, name, query in (
            ("athlete", asked.athlete, "SELECT athlete FROM athletes"),
            ("boat", asked.boat, f"SELECT DISTINCT boat FROM {recordings} WHERE boat > '' ORDER BY boat"),
            ("class of runs", asked.comparable, f"SELECT DISTINCT comparable FROM {runs} ORDER BY 1"),
        ):
            if name is not None and name not in (known := self._values(query)):
                raise not_in_season(what, name, known)

    def _values(self, sql: str) -> list[str]:
        return [row[0] for row in self._connection.execute(sql).fetchall()]

    def _rows(self) -> str:
        """The condition on rows of `recordings` and `strokes`."""
        asked, found = self.selection, ["true"]
        named = {"athlete": asked.athlete, "boat": asked.boat, "comparable": asked.comparable}
        found += [f"{column} = {_text(text)}" for column, text in named.items() if text is not None]
        if asked.scope is not None:
            found.append("athlete IN (SELECT athlete FROM athletes)")
        if asked.since is not None:
            found.append(f"started >= TIMESTAMPTZ {_text(f'{asked.since} 00:00:00+00')}")
        if asked.until is not None:
            found.append(f"started < TIMESTAMPTZ {_text(f'{asked.until} 00:00:00+00')} + INTERVAL 1 DAY")
        return " AND ".join(found)

    def _run(self, sql: str) -> None:
        self._connection.execute(sql)


_KINDS = {"string": "VARCHAR", "timestamp[us, tz=UTC]": "TIMESTAMPTZ", "int32": "INTEGER"}


def _connected(address: str) -> Any:
    try:
        import duckdb
    except ImportError:
        raise DataError(
            f'{address}: questions need one more package: pip install "oarlock[season]"'
        ) from None
    return duckdb.connect(":memory:", config=_SETTINGS)


def _is_of_files(error: BaseException) -> bool:
    """Whether DuckDB could not read a file; the other errors are of our own statements."""
    import duckdb

    own = (duckdb.ParserException, duckdb.BinderException, duckdb.CatalogException)
    return isinstance(error, duckdb.Error) and not isinstance(error, own)


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


def _quantiles(share: float) -> list[float]:
    """Quantiles of Student's t for 1, 2, 3 ... degrees of freedom."""
    return [round(student_quantile(share, count), 6) for count in range(1, _MOST_DF + 1)]


def _read(paths: Sequence[Path]) -> str:
    files_ = ", ".join(_text(str(path)) for path in paths)
    return f"read_parquet([{files_}], union_by_name = true, hive_partitioning = false)"


def _text(text: str) -> str:
    """A text of SQL."""
    return "'" + text.replace("'", "''") + "'"
