"""A page that shows one moving hand and nothing else."""

from __future__ import annotations

from pathlib import Path

import jinja2
from markupsafe import Markup

import stages.report
from stages.report.hand_motion import HandMotion
from stages.report.palette import css
from stages.report.viewer.view import view_of

PAGE = """{% extends "base.html.j2" %}
{% from "viewer/viewer.html.j2" import hand_viewer %}
{% block title %}{{ view.title }}{% endblock %}
{% block styles %}{% include "viewer/viewer.css" %}{% endblock %}
{% block scripts %}{% include "viewer/viewer.js" %}{% endblock %}
{% block content %}
<h1>{{ view.title }}</h1>
{{ hand_viewer(view) }}
{% endblock %}"""


def page_of_viewer(title: str, motion: HandMotion) -> str:
    """The page, which asks nothing of any other computer."""
    loader = jinja2.FileSystemLoader(Path(stages.report.__file__).parent)
    environment = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(PAGE)
    return template.render(version="0", palette=Markup(css()), view=view_of(title, motion))
