"""Translation of sentences into the language of a page by gettext; without a language, they stay in English.

`tr` translates a sentence, `ngettext` a sentence with a plural, and `word` the name of a joint, segment or
digit. A constant is marked by `N_` and translated when it is displayed. This module does not read catalogues:
the code that makes pages reads them and sets the translations by `translating`.
"""

from __future__ import annotations

import gettext
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

Template = str | tuple[str, str]
"""An English sentence with placeholders, or the singular and plural forms of one about a number `n`."""

ENGLISH = "en"
FOREIGN, END = "\ue000", "\ue001"
"""Private-use characters that enclose text which stays English on a page in another language."""

NAMES = {"hand", "digit", "digits", "joint", "joints", "angle", "segment", "segments", "parent", "child"}
NAMES |= {"side", "across", "status"}
"""Placeholders whose values are translated, because they are names of this project and not of a study."""

_current: ContextVar[tuple[str, gettext.NullTranslations]] = ContextVar(
    "language", default=(ENGLISH, gettext.NullTranslations())
)


@contextmanager
def translating(code: str, translations: gettext.NullTranslations) -> Iterator[None]:
    """Translate the sentences composed in the block into the language `code`."""
    token = _current.set((code, translations))
    try:
        yield
    finally:
        _current.reset(token)


def language() -> str:
    """Return the code of the language in use."""
    return _current.get()[0]


def N_(sentence: str) -> str:  # noqa: N802
    """Mark an English sentence for the catalogues and return it unchanged."""
    return sentence


def plural(singular: str, several: str) -> tuple[str, str]:
    """Mark an English sentence about `n` things for the catalogues and return its two forms."""
    return singular, several


def tr(sentence: str, **values: Any) -> str:
    """Translate a sentence and fill in its placeholders."""
    text = _current.get()[1].gettext(sentence) if sentence else sentence
    return text.format(**_shown(values)) if values else text


def ngettext(singular: str, plural: str, n: int, **values: Any) -> str:
    """Translate a sentence about `n` things and fill in its placeholders, including `n`."""
    return _current.get()[1].ngettext(singular, plural, n).format(**_shown({"n": n, **values}))


def filled(template: Template, values: Mapping[str, Any]) -> str:
    """Translate a sentence and fill in its placeholders; the value `n` selects singular or plural."""
    return tr(template, **values) if isinstance(template, str) else ngettext(*template, **values)


def listed(names: Iterable[str]) -> str:
    """Join words as in a sentence: a, b and c."""
    words = list(names)
    return tr(" and ").join([tr(", ").join(words[:-1]), words[-1]] if len(words) > 1 else words)


_MARKS = (N_(", "), N_("; "), N_(": "), N_("."))
_EAST_ASIAN = "[\u3000-\u30ff\u3400-\u9fff\uff00-\uffef]"
_BESIDE = re.compile(
    rf"&#?\w+;|(?<={_EAST_ASIAN})(?:[,;:] |[.:;](?=\s*$))|[,;:] (?={_EAST_ASIAN})"
    rf"| ?\((?=[^()]*{_EAST_ASIAN})[^()]*\)|(?<={_EAST_ASIAN}) ?\([^()]*\)"
)
"""An HTML character reference, or half-width marks and brackets next to full-width characters."""


def punctuated(text: str) -> str:
    """Return a text with full-width punctuation next to full-width characters, if its language has it."""
    marks = {mark.strip(): tr(mark) for mark in _MARKS}
    if marks["."] == ".":
        return text

    def full_width(found: re.Match[str]) -> str:
        mark = found[0].strip()
        return f"（{mark[1:-1]}）" if mark.startswith("(") else marks.get(mark, found[0])

    return _BESIDE.sub(full_width, _BESIDE.sub(full_width, text))  # a bracket, then the full stop after it


def foreign(text: str) -> str:
    """Mark a text, such as another program's message, as English if the page is in another language."""
    if not text.strip() or language() == ENGLISH or FOREIGN in text:
        return text
    return f"{FOREIGN}{text}{END}"


def translated(text: str) -> str:
    """Return a text's translation in the language in use, or the text marked as English if it has none."""
    translation = tr(text)
    return translation if translation != text else foreign(text)


def _shown(values: Mapping[str, Any]) -> dict[str, Any]:
    texts = dict(values)
    for name, value in values.items():
        if name.rstrip("_0123456789") in NAMES and isinstance(value, str | list | tuple):
            texts[name] = word(value) if isinstance(value, str) else listed(map(word, value))
    return texts


_PARTS: Mapping[str, str] = {
    "cmc": N_("CMC"), "mcp": N_("MCP"), "pip": N_("PIP"), "dip": N_("DIP"), "ip": N_("IP"),
    "tip": N_("fingertip"),
    "metacarpal": N_("metacarpal"), "proximal": N_("proximal phalanx"), "middle": N_("middle phalanx"),
    "distal": N_("distal phalanx"),
}  # fmt: skip
"""Joints and bones of a digit by the last part of their names; English pages show the names unchanged."""

_WORDS = (
    N_("right"), N_("left"), N_("thumb"), N_("index"), N_("middle"), N_("ring"), N_("little"), N_("wrist"),
    N_("hand"), N_("forearm"), N_("flexion"), N_("abduction"), N_("rotation"), N_("axial rotation"),
    N_("used"), N_("excluded"), N_("failed"), N_("missing"), N_("refused"), N_("first-frame"),
    N_("least-squares"),
)  # fmt: skip
"""Other words in tables and layouts that are translated."""

_NAME = re.compile(r"(thumb|index|middle|ring|little)_([a-z]+)")


def word(name: str) -> str:
    """Return the name of a joint, segment, digit, hand or angle in the language in use."""
    if language() == ENGLISH:
        return name
    small = name.lower()
    match = _NAME.fullmatch(small.replace(" ", "_"))
    if match is None or match[2] not in _PARTS:
        translation = tr(small)
        return translation if translation != small else name
    return tr(match[1]) + tr(_PARTS[match[2]])
