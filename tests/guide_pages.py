"""Pages of the guide taken apart: code blocks with what stands before them, headings, links and pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PAGES = [*sorted((REPOSITORY / "docs").glob("*.md")), *sorted(REPOSITORY.glob("*.md"))]
NAMES = [page.relative_to(REPOSITORY).as_posix() for page in PAGES]

_FENCE = re.compile(
    r"^(?P<before>(?:[ ]*<!--[^\n]*-->\n\s*?)?)(?P<indent>[ ]*)```(?P<language>\w*)\n"
    r"(?P<text>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
_NOT_RUN = re.compile(r"<!-- not run: (?P<reason>\S.{5,}) -->")
_HEADING = re.compile(r"^#+ (.+?)$", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page. line : where it begins, from 1. not_run : why no test runs it, or empty."""

    page: Path
    line: int
    language: str
    text: str
    not_run: str

    def __str__(self) -> str:
        return f"{self.page.name}:{self.line}"


def blocks(page: Path, *languages: str) -> list[Block]:
    """Every fenced block of a page in those languages."""
    text = page.read_text("utf-8")
    return [block for block in _blocks(page, text) if block.language in languages]


def _blocks(page: Path, text: str) -> Iterator[Block]:
    for match in _FENCE.finditer(text):
        reason = _NOT_RUN.search(match["before"])
        line = text.count("\n", 0, match.start("language")) + 1
        indent = len(match["indent"])
        unindented = "".join(each[indent:] for each in match["text"].splitlines(keepends=True))
        yield Block(page, line, match["language"], unindented, reason["reason"] if reason else "")


def commands(block: Block) -> list[str]:
    """Lines of a shell block as a shell sees them: continued ones joined, comments left out."""
    lines = block.text.replace("\\\n", " ").splitlines()
    return [line for line in lines if line.strip() and not line.lstrip().startswith("#")]


def prose(page: Path) -> str:
    """A page without its blocks, code and comments."""
    text = _FENCE.sub("", page.read_text("utf-8"))
    return re.sub(r"`[^`\n]*`|<!--.*?-->", "", text, flags=re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and the site name them."""
    text = _FENCE.sub("", page.read_text("utf-8"))
    plain = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading) for heading in _HEADING.findall(text)]
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in plain}


def links(page: Path) -> list[tuple[str, str]]:
    """Links and pictures of a page that are no web addresses: file (empty: the page itself) and anchor."""
    targets = re.findall(r"\]\(([^)\s]+)[^)]*\)", _FENCE.sub("", page.read_text("utf-8")))
    local = [target for target in targets if not re.match(r"[a-z]+:", target)]
    return [(file, anchor) for file, _, anchor in (target.partition("#") for target in local)]


def pictures(page: Path) -> list[tuple[str, str]]:
    return re.findall(r"!\[([^\]]*)\]\(([^)\s]+)[^)]*\)", page.read_text("utf-8"))
