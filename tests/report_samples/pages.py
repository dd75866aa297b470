"""Reading pages back as tables and tags, and a page with a moving hand alone."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from html.parser import HTMLParser
from typing import Any

from shukotsu.report.hand_motion import HandMotion
from shukotsu.report.templates import ENVIRONMENT, render
from shukotsu.report.viewer import view_of

VOID = {"meta", "br", "hr", "link", "img", "input"}


@dataclass
class ReadTable:
    """A table of the page: its caption and its rows of cell texts."""

    caption: str = ""
    rows: list[list[str]] = field(default_factory=list)
    attributes: list[list[dict[str, str | None]]] = field(default_factory=list)


class PageReader(HTMLParser):
    """Collects tables and visible text; fails if tags are not properly nested."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.tables: list[ReadTable] = []
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Open a tag."""
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self.tables.append(ReadTable())
        elif tag == "tr":
            self.tables[-1].rows.append([])
            self.tables[-1].attributes.append([])
        elif tag in ("td", "th"):
            self.tables[-1].rows[-1].append("")
            self.tables[-1].attributes[-1].append({"tag": tag, **dict(attrs)})

    def handle_endtag(self, tag: str) -> None:
        """Close a tag, which must be the last one opened."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Add text to its cell or caption and to the page's text."""
        if self.open and self.open[-1] not in ("style",):
            self.text.append(data)
        if "caption" in self.open:
            self.tables[-1].caption += data
        elif {"td", "th"} & set(self.open) and "button" not in self.open:
            self.tables[-1].rows[-1][-1] += data


def rows_where(rows: Iterable[dict[str, Any]], **wanted: Any) -> list[dict[str, Any]]:
    """Return the rows whose columns have the wanted values."""
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def read_page(page: str) -> PageReader:
    """Read a page; AssertionError if its tags are not properly nested."""
    reader = PageReader()
    reader.feed(page)
    reader.close()
    assert not reader.open
    return reader


def table_called(page: str, caption: str) -> ReadTable:
    """Return the only table with a caption."""
    (captioned,) = [table for table in read_page(page).tables if table.caption == caption]
    return captioned


PAGE = """{% extends "base.html.j2" %}{% block title %}{{ title }}{% endblock %}
{% block styles %}{% include "viewer/viewer.css" %}{% endblock %}
{% block scripts %}{% include "viewer/viewer.js" %}{% endblock %}
{% block content %}<h1>{{ title }}</h1>
{% from "viewer/viewer.html.j2" import hand_viewer %}{{ hand_viewer(view) }}{% endblock %}"""


def page_of_viewer(title: str, motion: HandMotion) -> str:
    """Return a page that shows one moving hand and nothing else."""
    return render(ENVIRONMENT.from_string(PAGE), title=title, view=view_of(title, motion))
