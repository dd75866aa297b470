"""The report's templates, compiled on import in English, and what every page of it is given."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from schemas import VERSION
from stages.report.palette import css
from stages.report.wording import ENGLISH, Catalogue, catalogue_of, language, say, told, typeset

FOLDER = Path(__file__).parent
_TAGS = re.compile(r"(\{#.*?#\}|\{%.*?%\}|<[^>]*>)", re.DOTALL)
_SPOKEN = re.compile(r"""\b((?:aria-label|aria-roledescription|title|placeholder)=")([^"]*)(")""")
_QUOTED = re.compile(r'(?<=[(\[, ])"([^"\n]*)"')


def texts_of(source: str) -> list[str]:
    """What a template says, piece by piece, its spaces as one: between tags, in attributes that are read out,
    and in the expressions of its statements.
    """
    found: list[str] = []

    def keep(text: str) -> str:
        found.append(text)
        return text

    _with_texts(source, keep)
    return found


def _with_texts(source: str, own: Callable[[str], str]) -> str:
    parts = []
    for part in _TAGS.split(source):
        if not part.startswith(("<", "{%", "{#")):
            parts.append(_text(part, own))
        elif part.startswith("{%"):
            parts.append(_QUOTED.sub(lambda found: f'"{own(found[1])}"', part))
        else:
            parts.append(_SPOKEN.sub(lambda found: found[1] + own(found[2]) + found[3], part))
    return "".join(parts)


def _text(part: str, own: Callable[[str], str]) -> str:
    """A piece of text with its translation, in the spaces that it stands in."""
    inner = " ".join(part.split())
    if not re.search(r"[A-Za-z]", re.sub(r"\{\{.*?\}\}", _quoted_words, inner)):
        return part
    before, after = part[: len(part) - len(part.lstrip())], part[len(part.rstrip()) :]
    said = own(inner)
    return f"{before}{inner if said == inner else said}{after}" if said != inner else part


def _quoted_words(found: re.Match[str]) -> str:
    return " ".join(re.findall(r'"([^"]*)"', found[0]))


def in_language(path: str, source: str, spoken: Catalogue) -> str:
    """A template's or a script's source in another language."""
    if path.endswith(".js"):
        return _with_strings(source, spoken)
    if path.endswith(".j2"):
        return _with_texts(source, lambda text: spoken.pages.get(text, text))
    return source


def _with_strings(source: str, spoken: Catalogue) -> str:
    """A script with those of its strings that the catalogue has; nothing but whole strings changes."""
    for text, own in spoken.scripts.items():
        for quote in ('"', "`"):
            source = source.replace(f"{quote}{text}{quote}", f"{quote}{own}{quote}")
    return source


class _Loader(jinja2.FileSystemLoader):
    """Loads templates in one language."""

    def __init__(self, own: str) -> None:
        super().__init__(FOLDER)
        self.own = own

    def get_source(
        self, environment: jinja2.Environment, template: str
    ) -> tuple[str, str, Callable[[], bool]]:
        source, path, current = super().get_source(environment, template)
        if self.own != ENGLISH:
            source = in_language(template, source, catalogue_of(self.own))
        return source, path, current


def coded(text: object) -> Markup:
    """Text, escaped, with what stands between backticks as code."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


@cache
def environment(own: str) -> jinja2.Environment:
    """The templates in a language, compiled: to compile one takes longer than to fill it in."""
    made = jinja2.Environment(
        loader=_Loader(own),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals |= {"language": own, "say": say, "told": told}
    made.filters["coded"] = coded
    for name in made.list_templates(extensions=("j2", "css", "js")):
        made.get_template(name)
    return made


ENVIRONMENT = environment(ENGLISH)  # here, before any fork


def render(template: str | jinja2.Template, **content: Any) -> str:
    """Fill in a template, by its path in this folder; text is escaped, a name not given is an error."""
    made = environment(language()).get_template(template)
    return typeset(made.render(version=VERSION, palette=Markup(css()), **content) + "\n")
