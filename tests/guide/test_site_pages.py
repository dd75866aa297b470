"""What the site shows of charts, writers before readers, and of a notebook's cells."""

from guide_pages import REPOSITORY
from mkdocs.config.defaults import MkDocsConfig

from guide.diagram import PAGE, RuleGraph, mermaid
from guide.site_pages import CHART, HEAD, MARK, as_table, cells_as_markdown, on_page_markdown

NOTEBOOK = {
    "cells": [
        {"cell_type": "markdown", "source": ["## A question\n", "Why?"]},
        {"cell_type": "code", "source": ["x = 1\n", "x"], "outputs": [{"text": "1"}]},
    ]
}
GRAPH = RuleGraph({"draw": ["report.html"], "solve": ["joints", "planes"]}, [("solve", "draw")])
TABLE = f"{HEAD['en']}\n| **solve** | joints, planes | draw |\n| **draw** | report.html |  |"


def test_a_chart_of_rules_is_a_table_in_their_order() -> None:
    assert as_table(mermaid(GRAPH)) == TABLE


def test_every_chart_of_the_guide_is_turned() -> None:
    assert CHART.search(PAGE.read_text("utf-8"))
    config = MkDocsConfig()
    config.docs_dir = str(REPOSITORY / "docs")
    for page in (REPOSITORY / "docs").glob("*.md"):
        text = on_page_markdown(page.read_text("utf-8"), page=None, config=config)
        assert "```mermaid" not in text, page.name


def test_cells_are_text_and_blocks_without_outputs() -> None:
    assert cells_as_markdown(NOTEBOOK) == "## A question\nWhy?\n\n```python\nx = 1\nx\n```"


def test_notebooks_are_kept_without_outputs() -> None:
    notebooks = sorted((REPOSITORY / "docs").rglob("*.ipynb"))
    assert notebooks
    for path in notebooks:
        text = path.read_text("utf-8")
        assert '"outputs": []' in text
        assert text.count('"outputs": []') == text.count('"outputs"') == text.count('"execution_count": null')


def test_every_notebook_is_on_a_page() -> None:
    pages = [page.read_text("utf-8") for page in (REPOSITORY / "docs").glob("*.md")]
    shown = {name for page in pages for name in MARK.findall(page)}
    folder = REPOSITORY / "docs"
    assert shown == {path.relative_to(folder).as_posix() for path in folder.rglob("*.ipynb")}
