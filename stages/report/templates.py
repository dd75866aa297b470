"""The report's templates, compiled on import, and what every page of it is given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from schemas import VERSION
from stages.report.palette import css

ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
for _name in ENVIRONMENT.list_templates(extensions=("j2", "css", "js")):
    ENVIRONMENT.get_template(_name)  # here, before any fork: to compile one takes longer than to fill it in


def render(template: str | jinja2.Template, **content: Any) -> str:
    """Fill in a template, by its path in this folder; text is escaped, a name not given is an error."""
    return ENVIRONMENT.get_template(template).render(version=VERSION, palette=Markup(css()), **content) + "\n"
