"""The report's language: every sentence stands in the code in English, for the others in a catalogue.

`say` gives a sentence in the language that `speaking` sets; outside of it, in English. A constant of a module
is marked by `mark` and said where it is shown. Sentences that come with the tables are `told`, by patterns.
What a catalogue does not have stays English between FOREIGN and END; `typeset` makes that an element with its
language.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import yaml

from schemas.finding_groups import is_declared, row_sentence, row_what
from schemas.study import Hand, SubjectSession

ENGLISH = "en"
CATALOGUES = Path(__file__).parent / "languages"

FOREIGN, END = "\ue000", "\ue001"
"""Around what stays English in another language's report: private characters, without a meaning."""

WORDS = frozenset(
    {"hand", "digit", "digits", "joint", "joints", "angle", "segment", "segments", "side", "across", "status"}
)
"""Placeholders whose values are words of the project, not names of a study."""
CODE = "code"
"""Placeholder whose value is to be written into a file as it is."""
MESSAGES = frozenset({"message", "reason", "why", "error", "trouble"})
"""Placeholders whose values are sentences that came with the tables."""

_SINGLE = frozenset({"hand", "digit", "joint", "angle", "segment"})
_ANY = frozenset({"rest", "text"})
"""Placeholders of patterns that stand for one word, and for anything; others hold no colon or semicolon."""
_TOLD = frozenset({"message", "question", "test"})
_WORDS = frozenset({"hand", "digit", "angle", "binding", "across", "Hand"})
"""Columns of tables whose texts are sentences, and whose texts are words."""

_NAME = re.compile(
    r"(thumb|index|middle|ring|little)_(cmc|mcp|pip|dip|ip|tip|metacarpal|proximal|middle|distal)"
)
_TEXT = re.compile(r"(<(script|style)\b.*?</\2>|<title>.*?</title>|<[^>]*>)", re.DOTALL)


@dataclass(frozen=True)
class Catalogue:
    """One language, by the English texts.

    fonts : that can write it, the best first. sentences : of the code. counts : of things. pages : texts of
    templates. scripts : strings of scripts. messages : patterns, and what they become. tidy : corrections of
    typography, each a pattern and what replaces it.
    """

    language: str
    fonts: tuple[str, ...]
    sentences: Mapping[str, str]
    counts: Mapping[str, str]
    pages: Mapping[str, str]
    scripts: Mapping[str, str]
    words: Mapping[str, str]
    messages: tuple[tuple[re.Pattern[str], str], ...]
    tidy: tuple[tuple[re.Pattern[str], str], ...]


@cache
def catalogue_of(language: str) -> Catalogue:
    """Read a language's catalogue."""
    with (CATALOGUES / f"{language}.yaml").open(encoding="utf-8") as stream:
        found = yaml.CSafeLoader(stream).get_single_data()
    return Catalogue(
        language,
        tuple(found["font"]),
        found["sentences"],
        found["counts"],
        found["pages"],
        found["scripts"],
        found["words"],
        tuple((_pattern(english), own) for english, own in found["messages"].items()),
        tuple((re.compile(pattern), own) for pattern, own in found["tidy"].items()),
    )


def _pattern(sentence: str) -> re.Pattern[str]:
    """What finds the sentence: a placeholder stands for anything."""
    parts = re.split(r"\{(\w+)\}", sentence.rstrip("."))
    seen: set[str] = set()
    text = ""
    for place, part in enumerate(parts):
        if place % 2 == 0:
            text += re.escape(part)
        else:
            kind = part.rstrip("_0123456789")
            own = r"[^\s:;,]+" if kind in _SINGLE else ".+?" if kind in MESSAGES | _ANY else "[^:;]+?"
            text += f"(?P={part})" if part in seen else f"(?P<{part}>{own})"
            seen.add(part)
    return re.compile(text, re.DOTALL)


_spoken: ContextVar[Catalogue | None] = ContextVar("spoken", default=None)
_findings: ContextVar[Mapping[str, Callable[..., str]] | None] = ContextVar("findings", default=None)


@contextmanager
def speaking(language: str, problems: Iterable[dict[str, Any]] = ()) -> Iterator[None]:
    """What is said inside is said in that language.

    problems : rows of that table; their sentences, which messages of other tables quote whole or without the
    cure, are said by their values.
    """
    token = _spoken.set(None if language == ENGLISH else catalogue_of(language))
    declared = [row for row in problems if is_declared(row)]
    whole = {row["message"].removesuffix("."): partial(row_sentence, row) for row in declared}
    quoted = _findings.set({row_what(row): partial(row_what, row) for row in declared} | whole)
    try:
        yield
    finally:
        _findings.reset(quoted)
        _spoken.reset(token)


def language() -> str:
    """The language that is spoken."""
    spoken = _spoken.get()
    return ENGLISH if spoken is None else spoken.language


def mark(sentence: str) -> str:
    """The English sentence as it is: it is said where it is shown."""
    return sentence


def say(sentence: str, **values: Any) -> str:
    """The sentence in the language spoken, with values in its placeholders."""
    spoken = _spoken.get()
    if spoken is None:
        return sentence.format(**values) if values else sentence
    own = spoken.sentences.get(sentence, sentence)
    return own.format(**{name: _value(name, value) for name, value in values.items()}) if values else own


def _value(name: str, value: Any) -> Any:
    if isinstance(value, Hand):
        return say("{who}, {hand} hand", who=value.who, hand=value.hand)
    if isinstance(value, SubjectSession):
        session = say(", session {session}", session=value.session) if value.session else ""
        return say("subject {subject}", subject=value.subject) + session
    if isinstance(value, str):
        kind = name.rstrip("_0123456789")
        return word(value) if kind in WORDS else told(value) if kind in MESSAGES else value
    return value


def say_count(count: int, thing: str) -> str:
    """The count with what is counted: 1 joint, 2 joints."""
    spoken = _spoken.get()
    if spoken is None:
        return f"{count} {thing}{'' if count == 1 else 's'}"
    return spoken.counts[f"{{count}} {thing}"].format(count=count)


def shown(column: str, text: str) -> str:
    """The text of a table's column as a page shows it: what is a name stays."""
    if column in _TOLD:
        return told(text)
    return word(text) if column in _WORDS else text


def full_name(joint: str) -> str:
    """A joint with its abbreviation and, in another language than English, what that stands for."""
    spoken, own = _spoken.get(), word(joint)
    full = spoken.words.get(f"{joint.rpartition('_')[2].upper()}_full") if spoken else None
    return f"{own} ({full})" if full else own


def word(name: str) -> str:
    """A joint, segment, digit, hand or angle as prose and pictures call it."""
    spoken = _spoken.get()
    if spoken is None:
        return name
    found = _NAME.fullmatch(name.lower().replace(" ", "_"))
    if name in spoken.words:
        return spoken.words[name]
    if found is None:
        return name
    digit, kind = found.groups()
    own = spoken.words.get(kind.upper() if kind in ("cmc", "mcp", "pip", "dip", "ip") else f"_{kind}", kind)
    bone = kind in ("metacarpal", "proximal", "middle", "distal")
    return spoken.words["_joined_bone" if bone else "_joined"].format(digit=spoken.words[digit], kind=own)


def told(message: str) -> str:
    """A sentence, or several, that came with the tables; what no pattern finds stays English."""
    spoken = _spoken.get()
    if spoken is None or not message.strip() or FOREIGN in message:
        return message
    whole = _found(spoken, message)
    if whole is not None:
        return whole
    parts = message.split("; ")
    for count in range(len(parts) - 1, 0, -1):
        first = _found(spoken, "; ".join(parts[:count]))
        if first is not None:
            return f"{first}; {told('; '.join(parts[count:]))}"
    return f"{FOREIGN}{message}{END}"


def _found(spoken: Catalogue, message: str) -> str | None:
    stop = "." if message.endswith(".") else ""
    text = message.removesuffix(".")
    quoted = (_findings.get() or {}).get(text)
    if quoted is not None:
        return quoted(say).removesuffix("。") + stop
    for pattern, own in spoken.messages:
        found = pattern.fullmatch(text) or pattern.fullmatch(text[:1].lower() + text[1:])
        if found is not None:
            values = {name: _told_value(spoken, name, value) for name, value in found.groupdict().items()}
            return own.rstrip("。").format(**values) + stop
    return spoken.sentences.get(message) or spoken.words.get(message)


def _told_value(catalogue: Catalogue, name: str, value: str) -> str:
    kind = name.rstrip("_0123456789")
    if kind == CODE:
        return value
    if kind in MESSAGES:
        return told(value)
    if kind in WORDS:
        return "、".join(map(word, re.split(", (?:and )?| and | or ", value)))
    return _found(catalogue, value) or value


def typeset(page: str) -> str:
    """A page as its language sets it; what stays English as elements with their language."""
    spoken = _spoken.get()
    if spoken is None:
        return page
    parts = _TEXT.split(page)  # text, element, its name, text, ...
    texts = [tidied(part).replace(FOREIGN, '<span lang="en">').replace(END, "</span>") for part in parts[::3]]
    elements = [plain(part) for part in parts[1::3]]
    return "".join(a + b for a, b in zip(texts, [*elements, ""], strict=True))


def tidied(text: str) -> str:
    """Text with the typography of the language spoken."""
    spoken = _spoken.get()
    for pattern, own in spoken.tidy if spoken else ():
        text = pattern.sub(own, text)
    return text


def plain(text: str) -> str:
    """Text without marks of what stays English, for where no element can stand."""
    return text.replace(FOREIGN, "").replace(END, "")
