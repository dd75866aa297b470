"""The report's language: every language but English is one gettext catalogue, `languages/CODE.po`.

`speaking` reads it; `shukotsu.translation` translates. What stays English on a page of another
language stands between FOREIGN and END; `typeset` makes that an element with its language.
"""

from __future__ import annotations

import gettext
import io
import re
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.translation import END, ENGLISH, FOREIGN, language, translating

CATALOGUES = Path(__file__).parent / "languages"
_TEXT = re.compile(r"(<(script|style)\b.*?</\2>|<title>.*?</title>|<[^>]*>)", re.DOTALL)


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
    """Return the context in which everything is said in a language."""
    return translating(code, translations_of(code))


def typeset(page: str) -> str:
    """Return a page with what stays English as elements with their language."""
    if language() == ENGLISH:
        return page
    parts = _TEXT.split(page)  # text, element, its name, text, ...
    texts = [part.replace(FOREIGN, '<span lang="en">').replace(END, "</span>") for part in parts[::3]]
    elements = [plain(part) for part in parts[1::3]]
    return "".join(a + b for a, b in zip(texts, [*elements, ""], strict=True))


def plain(text: str) -> str:
    """Return text without marks of what stays English, for where no element can stand."""
    return text.replace(FOREIGN, "").replace(END, "")
