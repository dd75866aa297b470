"""Pages of the guide: generated pages are current, charts have tables, pictures have descriptions."""

import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import make_pages
import pytest
from mkdocs.config.defaults import MkDocsConfig
from site_hook import CHART, HEAD, MARK, as_table, cells_as_markdown, on_page_markdown

from shukotsu.errors import InputError
from shukotsu.tables.catalogue import FOLDER

GENERATED = make_pages.pages()
"""The pages that `make docs` would write from the current schemas, by name."""
NODE = """{number} [ shape=none, margin=0, label=<<table border="2">
<b><font point-size="18">{rule}</font></b>
<tr><td align="left"> <b><font point-size="14">&#8618; input</font></b> </td></tr>
<td align="left"><font face="monospace">ignored.parquet</font></td>
<tr><td align="right"> <b><font point-size="14">output &rarr;</font></b> </td> </tr>
{files}
</table>>]
"""


def node(number: int, rule: str, *files: str) -> str:
    cells = "\n".join(f'<td align="left"><font face="monospace">{file}</font></td></tr>' for file in files)
    return NODE.format(number=number, rule=rule, files=cells)


@pytest.mark.parametrize("name", sorted(GENERATED))
def test_a_generated_page_is_current(name: str) -> None:
    assert (make_pages.DOCS / name).read_text("utf-8") == GENERATED[name], "run `make docs`"


def test_row_types_match_the_schemas() -> None:
    assert make_pages.ROWS.read_text("utf-8") == make_pages.row_types(), "run `make docs`"


@pytest.mark.parametrize(("right", "wrong"), [("meaning: xdf", "meening: xdf"), ("message:", "mesage:")])
def test_a_slip_in_a_tables_schema_is_named(tmp_path: Path, right: str, wrong: str) -> None:
    schemas = shutil.copytree(FOLDER, tmp_path / "schemas")
    clocks = schemas / "tables" / "clocks.yaml"
    clocks.write_text(clocks.read_text("utf-8").replace(right, wrong), "utf-8")
    with pytest.raises(InputError, match=rf"^{clocks}: columns\..*{wrong.partition(':')[0]}.*meaning"):
        make_pages.check_tables(schemas)


def test_rules_their_files_and_dependencies_are_parsed() -> None:
    dot = node(0, "all") + node(1, "solve", "r/sub-{subject,[^/]+}/joints.parquet", "r/a.html")
    dot += node(2, "cut", "r/planes.parquet") + "\t1 -> 2\n\t2 -> 0\n}"
    graph = make_pages.read_filegraph(dot)
    assert graph == ({"solve": ["joints", "a.html"], "cut": ["planes"]}, [("solve", "cut")])


def test_edges_implied_by_longer_paths_are_left_out() -> None:
    assert make_pages.direct_edges({"a": {"b", "c", "d"}, "b": {"c"}, "c": {"d"}, "d": set()}) == [
        ("a", "b"),
        ("b", "c"),
        ("c", "d"),
    ]


@pytest.mark.slow
def test_the_diagram_of_the_rules_is_current() -> None:
    page = make_pages.PAGE.read_text("utf-8")
    assert page == make_pages.page_with_diagram(page), "run `make docs`"


NOTEBOOK = {
    "cells": [
        {"cell_type": "markdown", "source": ["## A question\n", "Why?"]},
        {"cell_type": "code", "source": ["x = 1\n", "x"], "outputs": [{"text": "1"}]},
    ]
}
GRAPH = {"draw": ["report.html"], "solve": ["joints", "planes"]}, [("solve", "draw")]
TABLE = f"{HEAD['en']}\n| **solve** | joints, planes | draw |\n| **draw** | report.html |  |"


def test_a_chart_of_rules_becomes_a_table() -> None:
    assert as_table(make_pages.mermaid(*GRAPH)) == TABLE


def test_every_chart_of_the_guide_becomes_a_table() -> None:
    assert CHART.search(make_pages.PAGE.read_text("utf-8"))
    config = MkDocsConfig()
    config.docs_dir = str(make_pages.DOCS)
    for page in make_pages.DOCS.glob("*.md"):
        text = on_page_markdown(page.read_text("utf-8"), page=None, config=config)
        assert "```mermaid" not in text, page.name


def test_notebook_cells_become_text_and_code_blocks() -> None:
    assert cells_as_markdown(NOTEBOOK) == "## A question\nWhy?\n\n```python\nx = 1\nx\n```"


def test_notebooks_are_shown_on_a_page_and_stored_without_outputs() -> None:
    shown = {name for page in make_pages.DOCS.glob("*.md") for name in MARK.findall(page.read_text("utf-8"))}
    notebooks = {path.relative_to(make_pages.DOCS).as_posix() for path in make_pages.DOCS.rglob("*.ipynb")}
    assert shown == notebooks != set()
    for name in shown:
        text = text_of(name)
        assert '"outputs": []' in text
        assert text.count('"outputs": []') == text.count('"outputs"') == text.count('"execution_count": null')


PICTURES = sorted((make_pages.DOCS / "pictures").glob("*.svg"))
SVG = "{http://www.w3.org/2000/svg}"


def text_of(page: str) -> str:
    return (make_pages.DOCS / page).read_text("utf-8")


def test_every_picture_is_used_and_exists_in_both_languages() -> None:
    """A picture with text also exists in Japanese for the site, even if its page is not translated."""
    text = "".join(page.read_text("utf-8") for page in make_pages.DOCS.glob("*.md"))
    shown, names = set(re.findall(r"\(pictures/(.*?)\)", text)), {path.name for path in PICTURES}
    of_words = {path.name for path in PICTURES if "<text" in path.read_text("utf-8")}
    assert shown <= names
    assert {name for name in shown if not name.endswith(".ja.svg")} == {
        name.replace(".ja.svg", ".svg") for name in names
    }
    assert {
        name for name in of_words if name.replace(".ja.svg", ".svg").replace(".svg", ".ja.svg") not in names
    } == set()


@pytest.mark.parametrize("picture", PICTURES, ids=lambda path: path.name)
def test_a_picture_has_title_and_description_and_loads_nothing(picture: Path) -> None:
    text = picture.read_text("utf-8")
    root = ElementTree.fromstring(text)
    languages = {"ja"} if picture.name.endswith(".ja.svg") else {"en"}
    if root.find(f".//{SVG}text") is None:
        languages = {"en", "ja"}
    for tag in ("title", "desc"):
        words = {element.get("lang", root.get("lang")): element.text for element in root.iter(f"{SVG}{tag}")}
        assert words.keys() == languages
        assert all(words.values())
    assert not re.search(r"(?:href|src)=\"(?!#)|url\((?!#)|<script", text)


def test_the_protocol_lists_every_movement_of_the_calibration_page() -> None:
    protocol = text_of("protocol.md").lower()
    headings = re.findall(r"^\| !.*\*\*(.+)\*\*", text_of("calibrate.md"), re.MULTILINE)
    assert len(headings) == 12
    for heading in headings:
        assert heading.lower().replace("thumb, joint by joint", "thumb mcp joint, then ip joint") in protocol


def test_names_in_the_tables_of_the_architecture_exist() -> None:
    """Where `functions` stand before (`a/file.py`), as in the way of a number, the file defines them."""
    named = re.findall(r"((?:`[\w.]+`,? )+)\(`([\w/]+\.py)`\)", text_of("architecture.md"))
    assert len(named) > 60
    for names, file in named:
        source = (make_pages.DOCS.parent / file).read_text("utf-8")
        for name in re.findall(r"\w+", names):
            assert re.search(rf"^(?: *(?:def|class) |(?:\w+, )*){name}\b", source, re.MULTILINE), (file, name)
