"""A page that holds one part of the report alone, with the styles and scripts of the report's pages."""

from __future__ import annotations

from typing import Any

from shukotsu.report.hand_motion import HandMotion
from shukotsu.report.templates import ENVIRONMENT, render
from shukotsu.report.viewer import view_of

PAGE = """{% extends "base.html.j2" %}{% block title %}{{ title }}{% endblock %}
{% block styles %}{% include "viewer/viewer.css" %}{% endblock %}
{% block scripts %}{% include "viewer/viewer.js" %}{% endblock %}
{% block content %}<h1>{{ title }}</h1>BODY{% endblock %}"""


def small_page(body: str, title: str = "A part of the report", **content: Any) -> str:
    """Fill in a template's text, which may import the report's macros, as the report fills in its own."""
    return render(ENVIRONMENT.from_string(PAGE.replace("BODY", body)), title=title, **content)


def page_of_viewer(title: str, motion: HandMotion) -> str:
    """A page that shows one moving hand and nothing else."""
    body = '{% from "viewer/viewer.html.j2" import hand_viewer %}{{ hand_viewer(view) }}'
    return small_page(body, title, view=view_of(title, motion))
