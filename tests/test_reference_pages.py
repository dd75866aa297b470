"""The generated pages are those of today's schemas."""

from pathlib import Path

import pytest

from guide.reference_pages import pages

DOCS = Path(__file__).parent.parent / "docs"
PAGES = pages()


@pytest.mark.parametrize("name", sorted(PAGES))
def test_page_is_in_step(name: str) -> None:
    """`make docs` would change nothing."""
    assert (DOCS / name).read_text("utf-8") == PAGES[name], "run `make docs`"
