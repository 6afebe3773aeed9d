"""`make_setup` and `choose_setup`: the model, calibration and settings with which a season is computed."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

from oarlock import Calibration, Config, Model
from oarlock.recording.calibration import calibration_text, parsed_calibration
from oarlock.season.layout import SEASON_FILE
from oarlock.season.run_record import Setup
from oarlock.season.store import Season, not_in_season, open_season
from oarlock.storage.errors import DataError
from oarlock.storage.toml import toml_text

_NONE = "none"
_EVERYBODY = ""


def make_setup(model: Model, calibration: Calibration | None = None, config: Config | None = None) -> Setup:
    """The setup of a model with everything that it extends.

    Equal values give equal files, however they were written. What a calibration notes about its origin is left out.

    Raises:
        DataError: the model is no rower's, or has other parameters than its file.
    """
    from oarlock.rowing.analysis.rower_places import RowerFrames

    RowerFrames(model)
    if dict(Model.from_toml(model.text, "model.toml", {}).parameters) != dict(model.parameters):
        raise DataError("setup: the model has lengths other than its file; give them in a calibration")
    text = "" if calibration is None else calibration_text(replace(calibration, noted={}))
    return Setup(model.text.encode(), text.encode(), _settings(config or Config()))


def choose_setup(season: Season, setup: Setup, athlete: str | None = None) -> Season:
    """Store a setup and make it the current one of an athlete, or of everybody without one of their own.

    Raises:
        DataError: nobody has this pseudonym.
    """
    known = season.athletes()
    if athlete is not None and athlete not in known:
        raise not_in_season("athlete", athlete, known)
    season.put_setup(setup)
    now = open_season(season.place.address)  # another setup may have been chosen meanwhile
    key = _EVERYBODY if athlete is None else athlete
    changed = replace(now, place=season.place, setup={**now.setup, key: setup.name})
    season.place.write(SEASON_FILE, changed.toml())
    return changed


def setup_name(season: Season, athlete: str, kind: str) -> str:
    """Name of the setup of an athlete's recordings; empty if none was chosen. Exports need none."""
    if kind == "export":
        return Setup().name
    return season.setup.get(athlete, season.setup.get(_EVERYBODY, ""))


def opened_setup(setup: Setup) -> tuple[Model, Calibration | None, Config]:
    """What the files of a setup contain.

    Raises:
        DataError, ModelError: this version cannot read them.
    """
    model = Model.from_toml(setup.model.decode(), "model.toml", {})
    calibration = parsed_calibration(setup.calibration.decode()) if setup.calibration else None
    values = tomllib.loads(setup.settings.decode())
    settings: dict[str, Any] = {key: None if value == _NONE else value for key, value in values.items()}
    return model, calibration, Config(**settings)


def _settings(config: Config) -> bytes:
    """The settings that differ from the defaults."""
    usual: dict[str, Any] = Config().to_dict()
    own = {key: value for key, value in config.to_dict().items() if value != usual[key]}
    return toml_text({key: _NONE if own[key] is None else own[key] for key in sorted(own)}).encode()


def absolute_address(season: Season) -> str:
    """The address by which other processes find the season."""
    address = season.place.address
    return address if "://" in address else str(Path(address).absolute())
