"""Sentences in the language of a page, by gettext; English, as it stands in the code, wherever none is set.

`tr` translates a sentence, `ngettext` one with a plural, `word` the name of a joint, a segment or a digit. A
constant is marked by `N_` and translated where it is shown. Nothing here reads a catalogue: whoever makes
pages does, and sets its translations (`translating`).
"""

from __future__ import annotations

import gettext
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

Template = str | tuple[str, str]
"""An English sentence with placeholders; one about a number `n` in the singular and the plural."""

ENGLISH = "en"
FOREIGN, END = "\ue000", "\ue001"
"""Around what stays English on a page of another language: private characters, without a meaning."""

NAMES = {"hand", "digit", "digits", "joint", "joints", "angle", "segment", "segments", "parent", "child"}
NAMES |= {"side", "across", "status"}
"""Placeholders whose values are names of the project, which are translated, and not of a study."""

_current: ContextVar[tuple[str, gettext.NullTranslations]] = ContextVar(
    "language", default=(ENGLISH, gettext.NullTranslations())
)


@contextmanager
def translating(code: str, translations: gettext.NullTranslations) -> Iterator[None]:
    """Translate what is said inside into a language."""
    token = _current.set((code, translations))
    try:
        yield
    finally:
        _current.reset(token)


def language() -> str:
    """Return the code of the language in use."""
    return _current.get()[0]


def N_(sentence: str) -> str:  # noqa: N802
    """Mark an English sentence for the catalogues and return it as it is."""
    return sentence


def plural(singular: str, several: str) -> tuple[str, str]:
    """Mark an English sentence about `n` things for the catalogues and return its two forms."""
    return singular, several


def tr(sentence: str, **values: Any) -> str:
    """Translate the sentence and put values into its placeholders."""
    own = _current.get()[1].gettext(sentence) if sentence else sentence
    return own.format(**_shown(values)) if values else own


def ngettext(singular: str, plural: str, n: int, **values: Any) -> str:
    """Translate a sentence about `n` things and put values, and n, into its placeholders."""
    return _current.get()[1].ngettext(singular, plural, n).format(**_shown({"n": n, **values}))


def filled(template: Template, values: Mapping[str, Any]) -> str:
    """Translate a sentence with its values; one with a plural by the value `n`."""
    return tr(template, **values) if isinstance(template, str) else ngettext(*template, **values)


def listed(names: Iterable[str]) -> str:
    """List words as a sentence does: a, b and c."""
    words = list(names)
    return tr(" and ").join([tr(", ").join(words[:-1]), words[-1]] if len(words) > 1 else words)


def foreign(text: str) -> str:
    """Mark an English text, such as another program's message, on a page of another language."""
    if not text.strip() or language() == ENGLISH or FOREIGN in text:
        return text
    return f"{FOREIGN}{text}{END}"


def translated(text: str) -> str:
    """Return a text of the catalogue in the language in use; another one marked as English."""
    translation = tr(text)
    return translation if translation != text else foreign(text)


def _shown(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _value(name, value) for name, value in values.items()}


def _value(name: str, value: Any) -> Any:
    if name.rstrip("_0123456789") not in NAMES:
        return value
    if isinstance(value, str):
        return word(value)
    return listed(map(word, value)) if isinstance(value, list | tuple) else value


_PARTS: Mapping[str, str] = {
    "cmc": N_("{digit} CMC"),
    "mcp": N_("{digit} MCP"),
    "pip": N_("{digit} PIP"),
    "dip": N_("{digit} DIP"),
    "ip": N_("{digit} IP"),
    "tip": N_("{digit} fingertip"),
    "metacarpal": N_("{digit} metacarpal"),
    "proximal": N_("{digit} proximal phalanx"),
    "middle": N_("{digit} middle phalanx"),
    "distal": N_("{digit} distal phalanx"),
}
"""Joints and bones of a digit by the last part of their names; English pages show the names themselves."""

_WORDS = (
    N_("axial rotation"), N_("right"), N_("left"), N_("Right"), N_("Left"), N_("Right hand"),
    N_("Left hand"), N_("thumb"), N_("index"), N_("middle"), N_("ring"), N_("little"), N_("Thumb"),
    N_("Index"), N_("Middle"), N_("Ring"), N_("Little"), N_("wrist"), N_("hand"), N_("forearm"),
    N_("flexion"), N_("abduction"), N_("rotation"), N_("Flexion"), N_("Abduction"), N_("Rotation"),
    N_("metacarpal"), N_("proximal phalanx"), N_("middle phalanx"), N_("distal phalanx"),
    N_("session"), N_("trial"), N_("used"), N_("excluded"), N_("failed"), N_("missing"), N_("weak"),
    N_("ok"), N_("yes"), N_("no"), N_("none"), N_("unknown"), N_("more"), N_("less"), N_("recorded"),
    N_("simulated"), N_("held out"), N_("first-frame"), N_("least-squares"), N_("mean"), N_("median"),
    N_("frame"), N_("receiver"), N_("back"), N_("side"),
)  # fmt: skip
"""Other words of tables and layouts, for the catalogues."""

_NAME = re.compile(r"(thumb|index|middle|ring|little)_([a-z]+)")


def word(name: str) -> str:
    """Return a joint, segment, digit, hand or angle as prose and pictures call it."""
    if language() == ENGLISH:
        return name
    found = _NAME.fullmatch(name.lower().replace(" ", "_"))
    if found is None or found[2] not in _PARTS:
        return tr(name)
    return tr(_PARTS[found[2]], digit=found[1])
