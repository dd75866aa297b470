"""A hook of MkDocs: a Mermaid flowchart is a table on the site, which then needs no script from elsewhere.

Programs that show the repository draw it; a browser would have to fetch what draws it.
"""

from __future__ import annotations

import re
from graphlib import TopologicalSorter

CHART = re.compile(r"^```mermaid\nflowchart \w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NODE = re.compile(r'^\s*(\w+)\["<b>(.*?)</b>(?:<br/>(.*))?"\]$', re.MULTILINE)
_EDGE = re.compile(r"^\s*(\w+) --> (\w+)$", re.MULTILINE)
HEAD = {
    "en": "| rule | writes | is read by |\n|---|---|---|",
    "ja": "| ルール | 書くもの | 読むルール |\n|---|---|---|",
}


def as_table(chart: str, language: str = "en") -> str:
    """A row a node: its name, what it writes, where its arrows lead; each after those that lead to it."""
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


def on_page_markdown(markdown: str, *, page: object, **_: object) -> str:
    """Put a table where each flowchart is."""
    language = getattr(getattr(page, "file", None), "locale", "en")
    return CHART.sub(lambda chart: as_table(chart[1], language), markdown)
