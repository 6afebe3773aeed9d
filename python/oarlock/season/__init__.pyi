"""The public names of `oarlock.season` and the modules that define them."""

from .add import Added, Admission
from .athletes import Athlete, NamesFile
from .entry import Entry
from .run_record import RunRecord, Setup
from .squad import changed_athlete
from .store import Season, create_season, open_season
from .summary import SeasonSummary, season_summary

__all__ = [
    "Added",
    "Admission",
    "Athlete",
    "Entry",
    "NamesFile",
    "RunRecord",
    "Season",
    "SeasonSummary",
    "Setup",
    "changed_athlete",
    "create_season",
    "open_season",
    "season_summary",
]
