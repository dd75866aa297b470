"""A hook of MkDocs: where a page says `<!-- notebook: PATH -->`, the site has the cells of that notebook."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig

MARK = re.compile(r"<!-- notebook: (\S+) -->")


def cells_as_markdown(notebook: dict[str, Any]) -> str:
    """Markdown of a notebook (nbformat 4): text as it stands, code in blocks, outputs left out."""
    parts = []
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        parts.append(f"```python\n{text}\n```" if cell["cell_type"] == "code" else text)
    return "\n\n".join(parts)


def on_page_markdown(markdown: str, *, config: MkDocsConfig, **_: object) -> str:
    """Put the cells of a page's notebooks where its marks are; a mark's path is below docs/."""

    def cells(match: re.Match[str]) -> str:
        path = Path(config.docs_dir, match[1])
        return cells_as_markdown(json.loads(path.read_text("utf-8")))

    return MARK.sub(cells, markdown)
