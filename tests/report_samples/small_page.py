"""A page that holds one part of the report alone, with its own styles and scripts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2

import stages.report
from stages.report.palette import css

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>A part of the report</title><link rel="icon" href="data:,">
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>{{ palette }}{% include "page.css" %}{% include "tables.css" %}
{% include "models_compared/models_compared.css" %}</style></head>
<body><main>BODY</main>
<script>{% include "tables.js" %}</script>
<script>{% include "models_compared/models_compared.js" %}</script></body></html>"""


def small_page(body: str, **content: Any) -> str:
    """Fill in a template's text, which may import the report's macros, as the report fills in its own."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(stages.report.__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.from_string(PAGE.replace("BODY", body)).render(palette=css(), **content)
