"""What is between a page's marks is replaced, and nothing else."""

import pytest

from shukotsu.errors import InputError
from shukotsu.tables.marked_text import replaced_between


def test_the_rest_of_the_page_stays() -> None:
    once = replaced_between("# Page\n\n<a>\nold\n<b>\n\nMore.\n", "<a>", "<b>", "new")
    assert once == "# Page\n\n<a>\n\nnew\n\n<b>\n\nMore.\n"
    assert replaced_between(once, "<a>", "<b>", "new") == once


@pytest.mark.parametrize("page", ["# Page\n", "<a> alone", "<b> before <a>"])
def test_a_page_without_its_marks_is_refused(page: str) -> None:
    with pytest.raises(InputError, match="lacks"):
        replaced_between(page, "<a>", "<b>", "new")
