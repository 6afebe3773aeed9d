"""Jinja templates escape what is text, leave what is markup, and refuse a value that is not there."""

import jinja2
import pytest

from html_page import Page
from oarlock.report import markup
from oarlock.report.section import KeyFigure, tiles

ODD = "<b>\"a\" & 'b'</b>"


@pytest.mark.parametrize(
    "written",
    [
        markup.figure(ODD, "<svg></svg>", unit=ODD, key="k"),
        markup.legend([("<path/>", ODD)]),
        markup.bar_legend([("used", ODD)]),
        markup.notes_list([ODD]),
        markup.table("k", ODD, [ODD, markup.Column("x", ODD, ODD)], [["1", "2"]]),
        tiles([KeyFigure(ODD, ODD, ODD)]),
    ],
)
def test_text_is_escaped(written):
    page = Page(written)
    assert page.errors == []
    assert ODD in page.text and '<b>"' not in written


def test_markup_stays_markup():
    cell, fact = '<a href="#x">1</a>', "<i>fact</i>"
    assert cell in markup.table("k", "caption", ["a", "b"], [["row", cell]], foot=[["sum", cell]])
    assert fact in markup.figure("name", "<svg></svg>", fact=fact)


def test_rows_of_a_table_have_a_header_and_a_style():
    page = Page(
        markup.table("k", "caption", ["a", "b"], [["r", "1"], ["s", "2"]], {1: "muted"}, style="sortable")
    )
    assert [a.get("scope") for a in page.all("th")] == ["col", "col", "row", "row"]
    assert [a.get("class") for a in page.all("tr")] == [None, None, "muted"]
    assert page.all("table") == [{"id": "k-table", "class": "sortable"}]


def test_a_value_that_is_missing_is_an_error():
    with pytest.raises(jinja2.UndefinedError, match="figures"):
        markup.rendered("tiles")
