"""The report's templates, compiled on import, what every page of it is given, and its language.

Every language but English is one gettext catalogue, `languages/CODE.po`: `speaking` reads it,
`shukotsu.translation` translates. What stays English on a page of another language stands between FOREIGN and
END; `typeset` makes that an element with its language.
"""

from __future__ import annotations

import gettext
import io
import re
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from shukotsu.errors import InputError
from shukotsu.report.palette import as_custom_property, css
from shukotsu.report.table_cells import capital
from shukotsu.resources import VERSION
from shukotsu.translation import END, ENGLISH, FOREIGN, N_, language, ngettext, punctuated, tr, translating

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
    """Escaped text, with text in backticks as code elements."""
    escaped = escape(text)
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escaped))) if "`" in escaped else escaped


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        extensions=["jinja2.ext.i18n"],
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["ext.i18n.trimmed"] = True
    environment.install_gettext_callables(tr, ngettext, newstyle=True)  # type: ignore[attr-defined]
    environment.globals |= {"language": language, "tr": tr}
    environment.globals["as_custom_property"] = as_custom_property
    environment.globals["script_texts"] = lambda: {name: tr(text) for name, text in SCRIPT_TEXTS.items()}
    environment.filters |= {"coded": coded, "capital": capital}
    for name in environment.list_templates(extensions=("j2", "css", "js")):
        environment.get_template(name)
    return environment


ENVIRONMENT = _environment()  # here, before any fork: to compile one takes longer than to fill it in


def render(template: str | jinja2.Template, **content: Any) -> str:
    """Fill in a template, by its path in this folder; text is escaped, a name not given is an error."""
    text = ENVIRONMENT.get_template(template).render(version=VERSION, palette=Markup(css()), **content)
    return typeset(text + "\n")


CATALOGUES = Path(__file__).parent / "languages"
_TEXT = re.compile(r"(<(script|style)\b.*?</\2>|<title>.*?</title>|<[^>]*>)", re.DOTALL)

_HEARD = re.compile(r'(?<= title=")[^"]*|(?<= aria-label=")[^"]*|(?<=<title>)[^<]*')
"""What a reader of the screen says, or a pointer shows."""


def languages() -> list[str]:
    """Return the codes of all languages: English, and those that have a catalogue."""
    return [ENGLISH, *sorted(path.stem for path in CATALOGUES.glob("*.po"))]


def check_language(code: str, option: str = "language") -> None:
    """Raise InputError where there is no catalogue of a language. option : that names it."""
    if code not in languages():
        raise InputError(f"{option}: is {code!r}; expected one of {', '.join(languages())}")


@cache
def translations_of(code: str) -> gettext.NullTranslations:
    """Read a language's catalogue, English has none; InputError where there is no such language."""
    check_language(code)
    if code == ENGLISH:
        return gettext.NullTranslations()
    from babel.messages.mofile import write_mo
    from babel.messages.pofile import read_po

    compiled = io.BytesIO()
    with (CATALOGUES / f"{code}.po").open(encoding="utf-8") as stream:
        write_mo(compiled, read_po(stream))
    compiled.seek(0)
    return gettext.GNUTranslations(compiled)


def speaking(code: str) -> AbstractContextManager[None]:
    """Return the context in which all text is in a language."""
    return translating(code, translations_of(code))


def typeset(page: str) -> str:
    """Return a page with what stays English as elements with their language."""
    if language() == ENGLISH:
        return page
    parts = _TEXT.split(page)  # text, element, its name, text, ...
    texts = [
        punctuated(part).replace(FOREIGN, '<span lang="en">').replace(END, "</span>") for part in parts[::3]
    ]
    elements = [_HEARD.sub(lambda found: punctuated(found[0]), plain(part)) for part in parts[1::3]]
    return "".join(a + b for a, b in zip(texts, [*elements, ""], strict=True))


def plain(text: str) -> str:
    """Return text without the marks of English passages, for places where no element is possible."""
    return text.replace(FOREIGN, "").replace(END, "")
