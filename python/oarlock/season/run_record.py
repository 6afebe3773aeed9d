"""`Setup` and `RunRecord`: what made a result, what it is named by, and how the run ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias, cast

from oarlock.season.entry import parsed_toml, texts
from oarlock.season.layout import RUN_FORMAT, named_by, named_by_document
from oarlock.storage.errors import DataError
from oarlock.storage.toml import toml_text

Status: TypeAlias = Literal["done", "failed"]
MODEL_FILE, CALIBRATION_FILE, SETTINGS_FILE = "model.toml", "calibration.toml", "settings.toml"


@dataclass(frozen=True)
class Setup:
    """The files that a run uses beside the recording.

    Args:
        model: model file with everything that it extends; empty for exports, which need none.
        calibration: calibration file; empty without one.
        settings: settings file of the filter; empty for the defaults.
    """

    model: bytes = b""
    calibration: bytes = b""
    settings: bytes = b""

    @property
    def name(self) -> str:
        """Its name, made of its contents."""
        return named_by(self.model, self.calibration, self.settings)

    @property
    def files(self) -> dict[str, bytes]:
        """Contents by name of the files that are there."""
        named = {MODEL_FILE: self.model, CALIBRATION_FILE: self.calibration, SETTINGS_FILE: self.settings}
        return {name: contents for name, contents in named.items() if contents}

    def run(self, engine: str) -> str:
        """Name of the run of this setup by an engine of this version."""
        return named_by_document({"engine": engine, "setup": self.name, "format": RUN_FORMAT})

    def comparable(self, engine: str) -> str:
        """Name of the runs whose numbers may be compared: one engine, model, settings and kind of calibration."""
        same = {"engine": engine, "model": named_by(self.model), "settings": named_by(self.settings)}
        return named_by_document({**same, "calibrated": bool(self.calibration)})[:8]


@dataclass(frozen=True)
class RunRecord:
    """How one run over one recording ended; the commit record of its result. It holds no times and no hosts.

    Args:
        recording: name of the recording.
        run: name of the run.
        engine: version of Oarlock.
        setup: name of the setup.
        comparable: numbers of runs with the same text may be compared.
        status: done, or failed.
        fault: why it failed, a sentence; empty if it did not.
        strokes: how many were found.
        files: SHA-256 by name in the result's folder.
        health: numbers about the sensors, by name.
    """

    recording: str
    run: str
    engine: str
    setup: str
    comparable: str
    status: Status
    fault: str = ""
    strokes: int = 0
    files: Mapping[str, str] = field(default_factory=dict)
    health: Mapping[str, float] = field(default_factory=dict)

    def toml(self) -> bytes:
        """The commit record."""
        plain = {
            key: getattr(self, key) for key in ("recording", "run", "engine", "setup", "comparable", "status")
        }
        tables = {"files": dict(sorted(self.files.items())), "health": dict(sorted(self.health.items()))}
        numbers = {"fault": self.fault, "strokes": self.strokes}
        return toml_text({"format": RUN_FORMAT, **plain, **numbers, **tables}).encode()

    @classmethod
    def parsed(cls, contents: bytes, where: str) -> RunRecord:
        """The record of a file.

        Raises:
            DataError: it is damaged.
        """
        table = parsed_toml(contents, where)
        table.check_format(RUN_FORMAT)
        status = table.string("status")
        if status not in ("done", "failed"):
            raise DataError(f'{table.where("status")}: is "{status}"; expected done or failed')
        health = table.table("health", {})
        return cls(
            **{key: table.string(key) for key in ("recording", "run", "engine", "setup", "comparable")},
            status=cast(Status, status),
            fault=table.string("fault"),
            strokes=table.integer("strokes", 0),
            files=texts(table.table("files", {})),
            health={key: health.number(key, 0.0) for key in health.values},
        )
