"""A hook of MkDocs: what the site shows in the place of what the repository's pages hold.

A Mermaid flowchart is a table, since a browser would have to fetch what draws it; where a page says
`<!-- notebook: PATH -->`, with a path below docs/, the cells of that notebook stand.
"""

from __future__ import annotations

import json
import re
from graphlib import TopologicalSorter
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig

MARK = re.compile(r"<!-- notebook: (\S+) -->")
CHART = re.compile(r"^```mermaid\nflowchart \w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NODE = re.compile(r'^\s*(\w+)\["<b>(.*?)</b>(?:<br/>(.*))?"\]$', re.MULTILINE)
_EDGE = re.compile(r"^\s*(\w+) --> (\w+)$", re.MULTILINE)
HEAD = {
    "en": "| rule | writes | is read by |\n|---|---|---|",
    "ja": "| ルール | 書くもの | 読むルール |\n|---|---|---|",
}


def as_table(chart: str, language: str = "en") -> str:
    """Return a row a node: name, what it writes, where its arrows lead; each after those that lead to it."""
    nodes = {name: (title, files) for name, title, files in _NODE.findall(chart)}
    edges = _EDGE.findall(chart)
    before: dict[str, set[str]] = {name: set() for name in nodes}
    for writer, reader in edges:
        before[reader].add(writer)
    rows = []
    for name in TopologicalSorter(before).static_order():
        title, files = nodes[name]
        readers = ", ".join(reader for writer, reader in edges if writer == name)
        rows.append(f"| **{title}** | {files.replace('<br/>', ', ')} | {readers} |")
    return "\n".join([HEAD.get(language, HEAD["en"]), *rows])


def cells_as_markdown(notebook: dict[str, Any]) -> str:
    """Return Markdown of a notebook (nbformat 4): text as it stands, code in blocks, outputs left out."""
    parts = []
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        parts.append(f"```python\n{text}\n```" if cell["cell_type"] == "code" else text)
    return "\n\n".join(parts)


def on_page_markdown(markdown: str, *, page: object, config: MkDocsConfig, **_: object) -> str:
    """Put a table where each flowchart is, and the cells of notebooks where their marks are."""
    language = getattr(getattr(page, "file", None), "locale", "en")
    markdown = CHART.sub(lambda chart: as_table(chart[1], language), markdown)
    notebooks = Path(config.docs_dir)
    return MARK.sub(
        lambda mark: cells_as_markdown(json.loads((notebooks / mark[1]).read_text("utf-8"))), markdown
    )
