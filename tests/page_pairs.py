"""A page of the guide in two languages, taken apart so that the two can be compared section by section."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
CODE = re.compile(r"`((?:[^`\n]|\n(?!\n))+)`")


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
        """Files of the pictures, in their order, whatever language their words are in."""
        return [
            target.replace(".ja.svg", ".svg") for picture, _, target in LINK.findall(self.text) if picture
        ]

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
    def numbers(self) -> set[str]:
        """Numbers in digits."""
        return set(
            re.findall(r"(?<![A-Za-z\d.])\d+(?:\.\d+)?", re.sub(r"(?<=\d)[\s,](?=\d{3})", "", self.prose))
        )


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
