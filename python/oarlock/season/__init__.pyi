"""The public names of `oarlock.season` and the modules that define them."""

from .add import Added, Admission
from .athletes import Athlete, NamesFile
from .earlier import EarlierPieces, earlier_pieces
from .entry import Entry
from .page.write import write_season_page
from .questions.ask import Change, Trend, ask, trend
from .questions.catalogue import QUESTIONS, Question
from .questions.database import Database
from .questions.selection import Selection
from .run_record import RunRecord, Setup
from .squad import changed_athlete
from .store import Season, create_season, open_season
from .summary import SeasonSummary, season_summary

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
    "open_season",
    "season_summary",
    "trend",
    "write_season_page",
]
