"""A flowchart as a table of its nodes, writers before readers."""

from guide_pages import REPOSITORY

from guide.diagram import PAGE, RuleGraph, mermaid
from guide.flow_tables import CHART, HEAD, as_table, on_page_markdown

GRAPH = RuleGraph({"draw": ["report.html"], "solve": ["joints", "planes"]}, [("solve", "draw")])
TABLE = f"{HEAD['en']}\n| **solve** | joints, planes | draw |\n| **draw** | report.html |  |"


def test_a_chart_of_rules_is_a_table_in_their_order() -> None:
    assert as_table(mermaid(GRAPH)) == TABLE


def test_every_chart_of_the_guide_is_turned() -> None:
    assert CHART.search(PAGE.read_text("utf-8"))
    for page in (REPOSITORY / "docs").glob("*.md"):
        assert "```mermaid" not in on_page_markdown(page.read_text("utf-8"), page=None), page.name
