"""The report's templates, and what every page of it is given."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from schemas import VERSION
from stages.report.palette import css


def render(template: str, **content: Any) -> str:
    """Fill in a template of this folder; text is escaped, and a name that is not given is an error."""
    return (
        _environment().get_template(template).render(version=VERSION, palette=Markup(css()), **content) + "\n"
    )


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
