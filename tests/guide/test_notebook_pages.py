"""A notebook's cells on a page of the site."""

from guide_pages import REPOSITORY

from guide.notebook_pages import MARK, cells_as_markdown

NOTEBOOK = {
    "cells": [
        {"cell_type": "markdown", "source": ["## A question\n", "Why?"]},
        {"cell_type": "code", "source": ["x = 1\n", "x"], "outputs": [{"text": "1"}]},
    ]
}


def test_cells_are_text_and_blocks_without_outputs() -> None:
    assert cells_as_markdown(NOTEBOOK) == "## A question\nWhy?\n\n```python\nx = 1\nx\n```"


def test_notebooks_are_kept_without_outputs() -> None:
    found = sorted((REPOSITORY / "docs").rglob("*.ipynb"))
    assert found
    for path in found:
        text = path.read_text("utf-8")
        assert '"outputs": []' in text
        assert text.count('"outputs": []') == text.count('"outputs"') == text.count('"execution_count": null')


def test_every_notebook_is_on_a_page() -> None:
    pages = [page.read_text("utf-8") for page in (REPOSITORY / "docs").glob("*.md")]
    shown = {name for page in pages for name in MARK.findall(page)}
    folder = REPOSITORY / "docs"
    assert shown == {path.relative_to(folder).as_posix() for path in folder.rglob("*.ipynb")}
