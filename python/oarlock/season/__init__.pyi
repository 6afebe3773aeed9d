"""The public names of `oarlock.season` and the modules that define them."""

from .add import Added, Admission, changed_athlete
from .athletes import Athlete, NamesFile
from .database import Database, Selection
from .earlier import EarlierPieces, earlier_pieces
from .page import write_season_page
from .questions import QUESTIONS, Change, Question, Trend, ask, left_out, trend
from .records import Entry, RunRecord, Setup
from .store import Season, create_season, open_season
from .tables import SeasonSummary, season_summary

__all__ = [
    "QUESTIONS",
    "Added",
    "Admission",
    "Athlete",
    "Change",
    "Database",
    "EarlierPieces",
    "Entry",
    "NamesFile",
    "Question",
    "RunRecord",
    "Season",
    "SeasonSummary",
    "Selection",
    "Setup",
    "Trend",
    "ask",
    "changed_athlete",
    "create_season",
    "earlier_pieces",
    "left_out",
    "open_season",
    "season_summary",
    "trend",
    "write_season_page",
]
