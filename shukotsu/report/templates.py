"""The report's templates, compiled on import, and what every page of it is given."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from shukotsu.report.palette import css
from shukotsu.report.wording import typeset
from shukotsu.resources import VERSION
from shukotsu.translation import N_, language, ngettext, tr

FOLDER = Path(__file__).parent

SCRIPT_TEXTS = {
    "pause": N_("Pause"),
    "play": N_("Play"),
    "moment": N_("frame {frame}, {time_s} s"),
    "fingertip": N_("fingertip"),
    "joint": N_("joint"),
    "still": N_("The hand does not move here: {error}."),
    "no_webgl": N_("this browser shows no WebGL 2"),
    "flexion": N_("flexion"),
    "abduction": N_("abduction"),
    "rotation": N_("rotation"),
    "sense_flexion": N_("flexion +, extension −"),
    "sense_abduction": N_("ulnar +, radial −"),
    "sense_rotation": N_("pronation +, supination −"),
    "tip_error": N_("tip error [mm]"),
    "tip_error_at": N_("Tip error [mm] at {where}"),
    "no_model": N_("no model is chosen"),
    "unknown": N_("not known"),
    "time": N_("time from the first frame [s]"),
}
"""What scripts say, by name: `wording(name, values)` of base.html.j2."""


def coded(text: object) -> Markup:
    """Text, escaped, with what stands between backticks as code."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def _environment() -> jinja2.Environment:
    made = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        extensions=["jinja2.ext.i18n"],
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.policies["ext.i18n.trimmed"] = True
    made.install_gettext_callables(tr, ngettext, newstyle=True)  # type: ignore[attr-defined]
    made.globals |= {"language": language, "tr": tr}
    made.globals["script_texts"] = lambda: {name: tr(text) for name, text in SCRIPT_TEXTS.items()}
    made.filters["coded"] = coded
    for name in made.list_templates(extensions=("j2", "css", "js")):
        made.get_template(name)
    return made


ENVIRONMENT = _environment()  # here, before any fork: to compile one takes longer than to fill it in


def render(template: str | jinja2.Template, **content: Any) -> str:
    """Fill in a template, by its path in this folder; text is escaped, a name not given is an error."""
    made = ENVIRONMENT.get_template(template)
    return typeset(made.render(version=VERSION, palette=Markup(css()), **content) + "\n")
