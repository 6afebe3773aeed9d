"""HTML reports of tracks, comparisons and studies, for every verb that writes a page.

A field of application, such as rowing, builds its own sections from these names.
"""

from oarlock.report.chart import Axis, Mark, Series, Zone, course_chart, plane_chart, row_chart
from oarlock.report.front import (
    Course,
    Front,
    Point,
    Sourced,
    belief_markup,
    date_of,
    front_markup,
    named_file,
    who_and_when,
)
from oarlock.report.markup import (
    Column,
    folded_help,
    grid,
    notes_list,
    sort_script,
    sortable_table,
    value_cell,
)
from oarlock.report.markup import table as plain_table
from oarlock.report.page import belief_of, doubtful_sensors, shell, who_in_words
from oarlock.report.section import KeyFigure, Section, tiles
from oarlock.report.summary_page import write_summary
from oarlock.report.text import capital, day_text, fixed
from oarlock.report.trust import Trust
from oarlock.report.write import write_page

__all__ = [
    "Axis",
    "Column",
    "Course",
    "Front",
    "KeyFigure",
    "Mark",
    "Point",
    "Section",
    "Series",
    "Sourced",
    "Trust",
    "Zone",
    "belief_markup",
    "belief_of",
    "capital",
    "course_chart",
    "date_of",
    "day_text",
    "doubtful_sensors",
    "fixed",
    "folded_help",
    "front_markup",
    "grid",
    "named_file",
    "notes_list",
    "plain_table",
    "plane_chart",
    "row_chart",
    "shell",
    "sort_script",
    "sortable_table",
    "tiles",
    "value_cell",
    "who_and_when",
    "who_in_words",
    "write_page",
    "write_summary",
]
