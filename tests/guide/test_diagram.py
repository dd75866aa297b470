"""The diagram of the guide is that of today's rules."""

import pytest

from guide.diagram import PAGE, RuleGraph, direct_edges, page_with_diagram, read_filegraph

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


def test_rules_their_files_and_who_reads_them_are_read() -> None:
    dot = node(0, "all") + node(1, "solve", "r/sub-{subject,[^/]+}/joints.parquet", "r/a.html")
    dot += node(2, "cut", "r/planes.parquet") + "\t1 -> 2\n\t2 -> 0\n}"
    graph = read_filegraph(dot)
    assert graph == RuleGraph({"solve": ["joints", "a.html"], "cut": ["planes"]}, [("solve", "cut")])


def test_what_a_longer_way_implies_is_left_out() -> None:
    assert direct_edges({"a": {"b", "c", "d"}, "b": {"c"}, "c": {"d"}, "d": set()}) == [
        ("a", "b"),
        ("b", "c"),
        ("c", "d"),
    ]


@pytest.mark.slow
def test_the_page_is_current() -> None:
    """`make docs` would change nothing."""
    page = PAGE.read_text("utf-8")
    assert page == page_with_diagram(page), "run `make docs`"
