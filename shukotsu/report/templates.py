"""The report's templates, which are compiled on import, and the language of its pages.

Each language other than English has a gettext catalogue, `languages/CODE.po`: `speaking` reads it, and
`shukotsu.translation` translates. Text that stays English on a page in another language is enclosed by
FOREIGN and END; `typeset` turns it into an element with the attribute `lang`.
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
    "still": N_("The hand cannot be shown in motion: {error}."),
    "no_webgl": N_("this browser does not support WebGL 2"),
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
    "time": N_("time since the first frame [s]"),
}
"""Texts used by scripts, by name, for `wording(name, values)` in base.html.j2."""


def coded(text: object) -> Markup:
    """Return escaped text, with text in backticks as code elements."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


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
    environment.globals |= {"language": language, "tr": tr, "as_custom_property": as_custom_property}
    environment.globals["script_texts"] = lambda: {name: tr(text) for name, text in SCRIPT_TEXTS.items()}
    environment.filters |= {"coded": coded, "capital": capital}
    for name in environment.list_templates(extensions=("j2", "css", "js")):
        environment.get_template(name)
    return environment


ENVIRONMENT = _environment()  # once, before any fork: compiling a template is slower than rendering it


def render(template: str | jinja2.Template, **content: Any) -> str:
    """Render a template, named by its path in this folder; text is escaped, a missing name is an error."""
    text = ENVIRONMENT.get_template(template).render(version=VERSION, palette=Markup(css()), **content)
    return typeset(text + "\n")


CATALOGUES = Path(__file__).parent / "languages"
_TEXT = re.compile(r"(<(script|style)\b.*?</\2>|<title>.*?</title>|<[^>]*>)", re.DOTALL)

_HEARD = re.compile(r'(?<= title=")[^"]*|(?<= aria-label=")[^"]*|(?<=<title>)[^<]*')
"""HTML attributes with text that a screen reader reads or a tooltip shows."""


def languages() -> list[str]:
    """Return the codes of all languages: English, and those with a catalogue."""
    return [ENGLISH, *sorted(path.stem for path in CATALOGUES.glob("*.po"))]


def check_language(code: str, option: str = "language") -> None:
    """Raise InputError if a language has no catalogue; option : name of the option, for the message."""
    if code not in languages():
        raise InputError(f"{option}: is {code!r}; expected one of {', '.join(languages())}")


@cache
def translations_of(code: str) -> gettext.NullTranslations:
    """Read a language's catalogue, which is empty for English. Raises InputError for an unknown language."""
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
    """Return a context in which all text is composed in a language."""
    return translating(code, translations_of(code))


def typeset(page: str) -> str:
    """Return a page with its English passages as elements that have the attribute `lang`."""
    if language() == ENGLISH:
        return page
    parts = _TEXT.split(page)  # text, element, its name, text, ...
    texts = [
        punctuated(part).replace(FOREIGN, '<span lang="en">').replace(END, "</span>") for part in parts[::3]
    ]
    elements = [_HEARD.sub(lambda found: punctuated(found[0]), plain(part)) for part in parts[1::3]]
    return "".join(a + b for a, b in zip(texts, [*elements, ""], strict=True))


def plain(text: str) -> str:
    """Return text without the marks of English passages, for use where no element is allowed."""
    return text.replace(FOREIGN, "").replace(END, "")
