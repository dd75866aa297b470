"""A page of the guide in two languages, taken apart so that the two can be compared section by section."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
CODE = re.compile(r"`((?:[^`\n]|\n(?!\n))+)`")
CHARACTER = r"[\u3040-\u30ff\u4e00-\u9fff]"
"""A Japanese letter, as a regular expression."""

UNITS = {
    "mm": "mm",
    "cm": "cm",
    "m": "m",
    "deg": "deg",
    "degrees": "deg",
    "°": "deg",
    "度": "deg",
    "%": "%",
    "s": "s",
    "seconds": "s",
    "秒": "s",
    "minutes": "min",
    "分": "min",
    "Hz": "Hz",
    "times": "times",
    "回": "times",
}
QUANTITY = re.compile(
    r"(?<![A-Za-z\d.])(\d{1,3}(?:[\s,]\d{3})+(?!\d)|\d+(?:\.\d+)?)\s?"
    r"(mm|cm|degrees|deg|seconds|minutes|times|Hz|[ms](?![A-Za-z])|[°度%秒分回])?"
)
NUMBER_WORDS = {
    "0": "zero|zeros",
    "0.5": "half",
    "1": "a|an|one|once|each|every|another|first|single",
    "2": "two|twice|both|pair|half|other|between|second",
    "3": "three|third",
    "4": "four",
    "5": "five",
    "6": "six",
    "7": "seven",
    "8": "eight",
    "9": "nine",
    "10": "ten",
    "12": "twelve",
    "16": "sixteen",
    "20": "twenty",
    "100": "hundred|hundreds",
}
"""Numbers that English spells out and Japanese writes in digits."""


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it, without fenced blocks. level : 0 before the first heading."""

    level: int
    heading: str
    text: str

    def __str__(self) -> str:
        return f"“{self.heading}”"

    @cached_property
    def links(self) -> list[str]:
        """Targets of the links, pictures left out; sorted, for languages put them in another order."""
        return sorted(target for picture, _, target in LINK.findall(self.text) if not picture)

    @cached_property
    def pictures(self) -> list[str]:
        """Files of the pictures, in their order."""
        return [target for picture, _, target in LINK.findall(self.text) if picture]

    @cached_property
    def codes(self) -> set[str]:
        """What stands between backquotes."""
        return {" ".join(code.split()) for code in CODE.findall(self.text)}

    @cached_property
    def tables(self) -> list[tuple[int, ...]]:
        """Of every table: the number of cells of each of its rows."""
        rows = [line.startswith("|") for line in self.text.splitlines()]
        found: list[list[int]] = []
        for before, is_row, line in zip([False, *rows], rows, self.text.splitlines(), strict=False):
            if is_row:
                found += [] if before else [[]]
                found[-1].append(line.count("|") - 1)
        return [tuple(table) for table in found]

    @cached_property
    def items(self) -> int:
        """Number of list items."""
        return len(re.findall(r"^ *(?:-|\d+\.) ", self.text, re.MULTILINE))

    @cached_property
    def prose(self) -> str:
        """What a reader reads: no code, no targets of links."""
        return CODE.sub(" ", LINK.sub(r"\2", self.text))

    @cached_property
    def quantities(self) -> set[tuple[str, str]]:
        """Numbers with their units, or an empty unit."""
        return _quantities(self.prose)

    @cached_property
    def quantities_in_code(self) -> set[tuple[str, str]]:
        """The same of what stands between backquotes: a translation may say what a message means."""
        return {quantity for code in self.codes for quantity in _quantities(code)}

    def spelled_numbers(self) -> set[str]:
        """Numbers, in digits, that the section's English writes as words."""
        words = set(re.findall(r"[a-z]+", self.prose.lower()))
        return {number for number, spelled in NUMBER_WORDS.items() if words & set(spelled.split("|"))}


def _quantities(text: str) -> set[tuple[str, str]]:
    return {(re.sub(r"[\s,]", "", number), UNITS.get(unit, "")) for number, unit in QUANTITY.findall(text)}


@dataclass(frozen=True)
class Page:
    """A page's text taken apart."""

    text: str

    @cached_property
    def blocks(self) -> list[tuple[str, str]]:
        """Language and lines of every fenced block; comments and the space around lines left out."""
        return [(language, _without_comments(text)) for _, language, text in FENCE.findall(self.text)]

    @cached_property
    def sections(self) -> list[Section]:
        """The page from heading to heading; comments left out."""
        text = re.sub(r"<!--.*?-->", "", FENCE.sub("", self.text), flags=re.DOTALL)
        parts = re.split(r"^(#+) (.+)$", text, flags=re.MULTILINE)
        before = [Section(0, "", parts[0])] if parts[0].strip() else []
        found = zip(parts[1::3], parts[2::3], parts[3::3], strict=True)
        return before + [Section(len(mark), heading, f"{heading}\n{rest}") for mark, heading, rest in found]

    def position_of(self, anchor: str) -> int:
        """Which heading an anchor leads to, from 0. Raises ValueError where there is none."""
        return [anchor_of(section.heading) for section in self.sections].index(anchor)


def _without_comments(text: str) -> str:
    lines = (re.sub(r"(^|\s+)# .*$", "", line).strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line)


def anchor_of(heading: str) -> str:
    """As GitHub and the site name it."""
    plain = LINK.sub(r"\2", heading)
    return re.sub(r"[^\w\- ]", "", plain.lower()).strip().replace(" ", "-")


def target_without_language(folder: Path, own: Path, target: str) -> str:
    """A link's target as the English page has it; an anchor of a translated page as its heading's position.

    folder, own : of the page that links, and the page itself. Raises ValueError for a lost anchor.
    """
    file, _, anchor = target.partition("#")
    if re.match(r"[a-z]+:", target):
        return target
    page = folder / file if file else own
    english = file.replace(".ja.", ".")
    translated = page.name.endswith(".ja.md") or page.with_suffix(".ja.md").exists()
    if not anchor or not translated:
        return f"{english}#{anchor}" if anchor else english
    return f"{english}#{Page(page.read_text('utf-8')).position_of(anchor)}"


def missing_quantities(english: Section, japanese: Section) -> list[str]:
    """Numbers with units that only one section has; Japanese may have in digits what English spells out."""
    lost = english.quantities - japanese.quantities
    new = japanese.quantities - english.quantities - english.quantities_in_code
    new = {quantity for quantity in new if quantity[0] not in english.spelled_numbers()}
    return [
        f"{' '.join(one)} {where}" for where, ones in (("lost", lost), ("new", new)) for one in sorted(ones)
    ]


def unclosed_emphasis(text: str) -> Iterator[str]:
    """Lines with `**` that CommonMark takes for asterisks: inside is punctuation, outside is a letter."""
    for line in CODE.sub("x", FENCE.sub("", text)).splitlines():
        parts = line.split("**")
        for position in range(1, len(parts)):
            before, after = (parts[position - 1] or " ")[-1], (parts[position] or " ")[0]
            inner, outer = (after, before) if position % 2 else (before, after)
            if inner.isspace() or (
                _is_punctuation(inner) and not (outer.isspace() or _is_punctuation(outer))
            ):
                yield line


def _is_punctuation(character: str) -> bool:
    return unicodedata.category(character)[0] in "PS"


def paragraphs(page: Page) -> Iterator[str]:
    """Plain paragraphs: no heading, table, list, quotation or picture."""
    for section in page.sections:
        body = section.text.partition("\n")[2] if section.level else section.text
        for paragraph in re.split(r"\n\s*\n", body):
            if paragraph.strip() and not re.match(r"\s*(\||-|\d+\.|>|!\[)", paragraph):
                yield paragraph.strip()
