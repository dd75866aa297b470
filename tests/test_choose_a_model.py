"""The numbers of docs/choose-a-model.md are those that docs/accuracy.md was measured to have."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
ESTIMATORS = {
    "`paper-fig4`": "paper-fig4",
    "`whole-hand`": "whole-hand",
    "... phalanges measured": "whole-hand + lengths",
    "... receivers' places too": "whole-hand + lengths, mounts",
}
JOINTS = {"MCP, index and middle": "MCP 2-3", "MCP, ring and little": "MCP 4-5"}


def measured(title: str) -> list[list[str]]:
    """Cells of every row of a table of the page of accuracy, found by how its title goes on."""
    text = (DOCS / "accuracy.md").read_text("utf-8").partition(f"accuracy: {title}")[2].partition("```")[0]
    return [re.split(r" {2,}", line.strip()) for line in text.splitlines()]


def chosen(head: str) -> list[list[str]]:
    """Cells of every row of a table of the page on models, by how its head begins."""
    text = (DOCS / "choose-a-model.md").read_text("utf-8").partition(f"| {head} ")[2].partition("\n\n")[0]
    return [line.strip("| ").split(" | ") for line in text.splitlines()[2:]]


@pytest.mark.parametrize("row", chosen("model | usual"), ids=lambda row: row[0])
def test_errors_are_those_measured(row: list[str]) -> None:
    found = {(cells[0], cells[1]): cells for cells in measured("scenarios side by side") if len(cells) > 6}
    cells = []
    for scenario in ("blend", "stiff DIPs"):
        _, _, _, median_mm, p90_mm, far_percent, *_ = found[scenario, ESTIMATORS[row[0]]]
        cells += [f"{median_mm} / {p90_mm}", f"{far_percent} %"]
    assert row[1:] == cells


@pytest.mark.parametrize("row", chosen("joint | `paper-fig4`"), ids=lambda row: row[0])
def test_errors_by_joint_are_those_measured(row: list[str]) -> None:
    found = {cells[0]: cells for cells in measured("blend by type of joint")}
    medians_mm = found[JOINTS.get(row[0], row[0])][3::2]
    assert row[1:] == medians_mm[:2]
