"""A hook of MkDocs: headings of a Japanese page have the English page's anchors, too.

Pages that have no Japanese translation link to headings by their English names.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.structure.pages import Page

_HEADING = re.compile(r"^ *```.*?^ *```$|^(?P<mark>#+) (?P<text>[^\n]+)$", re.MULTILINE | re.DOTALL)
"""A fenced block, in which a comment may look like a heading, or a heading."""


def anchors(markdown: str) -> list[str]:
    """The anchor of every heading, in their order: the one that it names ({#anchor}), or its words."""
    texts = (found["text"] for found in _HEADING.finditer(markdown) if found["mark"])
    return [_anchor(text) for text in texts]


def with_anchors(markdown: str, names: list[str]) -> str:
    """Put one more anchor into every heading. Raises ValueError where there are not as many as names."""
    left = list(names)

    def heading(found: re.Match[str]) -> str:
        return f'{found["mark"]} <a id="{left.pop(0)}"></a>{found["text"]}' if found["mark"] else found[0]

    if len(anchors(markdown)) != len(names):
        raise ValueError(f"{len(anchors(markdown))} headings; expected {len(names)}, as in English")
    return _HEADING.sub(heading, markdown)


def on_page_markdown(markdown: str, *, page: Page, **_: object) -> str:
    """Give a Japanese page the anchors of the English one beside it."""
    source = Path(str(page.file.abs_src_path))
    if not source.name.endswith(".ja.md"):
        return markdown
    english = source.with_name(source.name.replace(".ja.md", ".md"))
    return with_anchors(markdown, anchors(english.read_text("utf-8")))


def _anchor(text: str) -> str:
    named = re.search(r"\{#([\w-]+)\}$", text.strip())
    if named:
        return named[1]
    words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text.lower())
    return re.sub(r"[^\w\- ]", "", words).strip().replace(" ", "-")
