"""Tables in a real browser: sorted, filtered and saved, by mouse and by keyboard, and none of it on paper."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest
from browser import WatchedPage
from report_samples.small_page import small_page

from shukotsu.stages.report.table_cells import Block, DataTable, Folded

pytestmark = pytest.mark.slow

BODY = """{% from "macros.html.j2" import data_table, folded_table %}
{% for table in tables %}{{ data_table(table) }}{% endfor %}
{% for folded in folds %}{{ folded_table(folded) }}{% endfor %}"""

MIXED = DataTable(
    "Mixed: 95 % of 12/20 <b>?",
    (
        Block(
            ("Joint", "Status", "SD [mm]", "Range [mm]", "Counted"),
            (
                ("joint 10", "ok", "9.125 ± 0.45", "1.2 to 3.4", "12 of 20"),
                ("joint 9", "◆ weak", "9.50", "-0.5 to 0.2", "2 of 20"),
                ("joint 2", "ok", "–", "–", "100 of 120"),
                ("Älter", "✕ failed", "(9.75)", "< 0.0001", "7 of 7"),
                ("joint 1", "ok", "-3e-05", "0.2 to 0.3", ""),
            ),
        ),
    ),
    (),
    frozenset({0, 1}),
)
BLOCKS = DataTable(
    "CON",
    (
        Block(
            ("Thumb", "A [mm]", "B"),
            (("=1+1", "-2.5", "@x"), ('say "a, b"', "3", "+4"), ("-", "1", "-2+cmd|x")),
        ),
        Block(("Index", "A [mm]", "B"), (("c", "1", "two\nlines"), ("b", "–", "x"), ("a", "0.5", "y"))),
        Block(("Ring", "C [deg]", "B"), (("z", "2", "x"),)),
    ),
    (),
    frozenset({0, 2}),
)
LONG = DataTable(
    "Long: 指の関節, every row.",
    (
        Block(
            ("Row", *(f"Column {k} [mm]" for k in range(9))),
            tuple(
                (f"row {n}", *(f"{(n * 7919 + k) % 1009 / 100:.2f}" for k in range(9))) for n in range(1000)
            ),
        ),
    ),
)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with three tables, and one that is folded away."""
    path = tmp_path_factory.mktemp("tables") / "page.html"
    folds = [Folded("More", DataTable("Folded.", (Block(("Name", "N"), (("b", "1"), ("a", "2"))),)))]
    page = small_page(BODY, tables=[MIXED, BLOCKS, LONG], folds=folds)
    path.write_text(page, "utf-8")
    return path


@pytest.fixture
def page(watched_page: WatchedPage, file: Path) -> WatchedPage:
    """The page in the browser."""
    watched_page.open(file)
    return watched_page


def column(page: WatchedPage, table: int, place: int) -> list[str]:
    """The cells of a column, headers apart, in the order in which they are shown."""
    found: list[str] = page.value(
        """([table, place]) => [...document.querySelectorAll("table")[table].rows]
        .filter((row) => !row.hidden && row.cells[place].scope !== "col")
        .map((row) => row.cells[place].textContent.trim())""",
        [table, place],
    )
    return found


def press(page: WatchedPage, table: int, place: int, block: int = 0) -> None:
    page.page.locator("table").nth(table).locator("tr:has(th[scope=col])").nth(block).locator("th").nth(
        place
    ).get_by_role("button").click()


def saved(page: WatchedPage, table: int, folder: Path) -> tuple[str, str]:
    """The name and the text of the file that a table's button saves, byte order mark and all."""
    with page.page.expect_download() as told:
        page.page.locator("table").nth(table).locator("button.save-csv").click()
    told.value.save_as(folder / "saved.csv")
    return told.value.suggested_filename, (folder / "saved.csv").read_bytes().decode("utf-8")


def cells(text: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(text.removeprefix("\ufeff"), newline="")))


@pytest.mark.parametrize(
    ("place", "ascending", "descending"),
    [
        (0, [3, 4, 2, 1, 0], [0, 1, 2, 4, 3]),
        (2, [4, 0, 1, 3, 2], [3, 1, 0, 4, 2]),
        (3, [1, 3, 4, 0, 2], [0, 4, 3, 1, 2]),
        (4, [1, 3, 0, 2, 4], [2, 0, 3, 1, 4]),
    ],
)
def test_sorting(page: WatchedPage, place: int, ascending: list[int], descending: list[int]) -> None:
    """Numbers by the first of them, text as a reader counts, dashes last both ways; a third press undoes."""
    names = [row[0] for row in MIXED.blocks[0].rows]
    header = page.page.locator("table").nth(0).locator("thead th").nth(place)
    for wanted, said in ((ascending, "ascending"), (descending, "descending"), (range(5), None)):
        press(page, 0, place)
        assert column(page, 0, 0) == [names[row] for row in wanted]
        assert header.get_attribute("aria-sort") == said
    assert page.page.locator("[aria-sort]").count() == 0


def test_by_keyboard(page: WatchedPage) -> None:
    """Every control is reached with Tab and worked with Enter or Space; focus stays on the header pressed."""
    header = page.page.locator("table").nth(1).locator("tbody").nth(1).locator("th button").nth(0)
    header.focus()
    page.page.keyboard.press("Enter")
    assert column(page, 1, 0)[3:6] == ["a", "b", "c"]
    page.page.keyboard.press("Space")
    assert column(page, 1, 0)[3:6] == ["c", "b", "a"]
    assert header.evaluate("(button) => button === document.activeElement")
    page.page.keyboard.press("Tab")
    page.page.keyboard.press("Enter")
    assert column(page, 1, 0)[3:6] == ["a", "c", "b"]
    page.page.locator("table").nth(0).locator("button.save-csv").focus()
    with page.page.expect_download() as told:
        page.page.keyboard.press("Enter")
    assert told.value.suggested_filename == "Mixed-95-of-12-20-b.csv"


def test_saved_as_shown(page: WatchedPage, tmp_path: Path) -> None:
    """Cells, headers with units, the order and the rows shown; a mark first, for there is a ±."""
    press(page, 0, 2)
    name, text = saved(page, 0, tmp_path)
    assert name == "Mixed-95-of-12-20-b.csv"
    assert text.startswith("\ufeffJoint,Status,SD [mm],Range [mm],Counted\r\n")
    assert text.endswith("\r\n")
    header, *rows = cells(text)
    assert tuple(header) == MIXED.blocks[0].header
    assert [tuple(row) for row in rows] == [MIXED.blocks[0].rows[k] for k in (4, 0, 1, 3, 2)]


def test_filter(page: WatchedPage, tmp_path: Path) -> None:
    """Only tables of many rows have one; it counts what it shows, and that is saved, without a mark."""
    box, told = page.page.locator(".table-filter input"), page.page.locator(".table-filter output")
    assert box.count() == 1
    assert told.inner_text() == "1000 rows"
    box.fill("9.99 ROW")
    wanted = [row[0] for row in LONG.blocks[0].rows if "9.99" in row[1:]]
    assert len(wanted) > 5
    assert told.inner_text() == f"{len(wanted)} of 1000 rows"
    assert column(page, 2, 0) == wanted
    press(page, 2, 0)
    press(page, 2, 0)
    assert column(page, 2, 0) == sorted(wanted, key=lambda name: -int(name.split()[1]))
    name, text = saved(page, 2, tmp_path)
    assert name == "Long-指の関節-every-row.csv"
    assert text.startswith("Row,")
    assert [row[0] for row in cells(text)[1:]] == column(page, 2, 0)
    box.fill("row 99 nothing")
    assert column(page, 2, 0) == []
    box.fill("")
    assert told.inner_text() == "1000 of 1000 rows"
