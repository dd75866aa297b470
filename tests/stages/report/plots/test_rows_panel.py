"""Rows of dots: every number is drawn where it belongs, on a scale that a gross failure does not spoil."""

from __future__ import annotations

import re
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.stages.report.palette import MODELS, Look
from shukotsu.stages.report.plots import panels
from shukotsu.stages.report.plots.panels import (
    Panel,
    Row,
    Scale,
    draw_rows,
    locator,
    page_picture,
    taken_failures,
    value_scale,
)

LOOK = Look(MODELS[0], "s")
NUMBERS = st.lists(st.floats(-500.0, 500.0).map(lambda value: round(value, 3)), min_size=1, max_size=40)


def places(picture: str) -> np.ndarray:
    """Return where the dots of a picture are, (n, 2)."""
    found = re.findall(r'<use xlink:href="#\w+" x="([\d.]+)" y="([\d.]+)" style="[^"]*opacity', picture)
    return np.array(found, float).reshape(-1, 2)


def panel(scale: Scale, *rows: Row, n: int) -> Panel:
    draw = partial(draw_rows, rows=rows, axis="mm", scale=scale, of_all=n)
    return Panel("", "Thumb <1>", 3.6 * (len(rows) + 1), 9.0, draw)


@given(NUMBERS)
def test_scales_hold_every_number(values: list[float]) -> None:
    """All but those that are next to nothing on a logarithmic scale."""
    numbers = np.array(values)
    errors = value_scale(np.abs(numbers))
    assert errors.high >= np.abs(numbers).max()
    assert errors.low <= max(np.abs(numbers)[numbers != 0].min(initial=500.0), errors.high / 1e4)


@pytest.mark.parametrize(("gross", "kind"), [(4.0, "linear"), (150.0, "log"), (9000.0, "log")])
def test_gross_failures_flatten_nothing(gross: float, kind: str) -> None:
    """The usual numbers keep a good part of the axis beside one of centimetres."""
    usual = np.linspace(1.0, 3.0, 30)
    assert value_scale(np.append(usual, gross)).kind == kind


@pytest.mark.parametrize(
    ("scale", "expected"),
    [
        (Scale(-1.0, 9.3), [0, 2, 4, 6, 8]),
        (Scale(0.8, 9.0, "log"), [1, 2, 5]),
        (Scale(0.4, 300.0, "log"), [1, 3, 10, 30, 100, 300]),
    ],
)
def test_ticks_are_round_numbers(scale: Scale, expected: list[float]) -> None:
    ticks = locator(scale).tick_values(scale.low, scale.high)
    assert [tick for tick in ticks if scale.low <= tick <= scale.high] == pytest.approx(expected)


@pytest.mark.parametrize("n", [3, 31])
def test_every_subject_is_drawn(n: int) -> None:
    """A dot a number, over its value; missing ones are counted; the same bytes twice."""
    first = Row("a & b", LOOK, {f"S{k}": k + 1.0 for k in range(n)})
    scale = value_scale(np.arange(1.0, n + 1))
    picture = page_picture(panel(scale, first, Row("c", LOOK, {"S0": 1.0}), Row("none", LOOK), n=n))
    assert picture == page_picture(panel(scale, first, Row("c", LOOK, {"S0": 1.0}), Row("none", LOOK), n=n))
    found = places(picture)
    assert len(found) == n + 1
    row = np.sort(found[found[:, 1] < found[:, 1].min() + 7][:, 0])
    along = np.arange(1.0, n + 1)
    np.testing.assert_allclose(row, np.polyval(np.polyfit(along, row, 1), along), atol=0.1)
    assert ">1.00 (n = 1)<" in picture
    assert "a &amp; b" in picture
    assert "Thumb &lt;1&gt;" in picture


def test_rounding_errors_stretch_no_scale() -> None:
    """They are nothing beside nothing, and at the foot beside a gross number; every dot is drawn."""
    nothing = [9e-15, 2e-13, 0.0]
    assert value_scale(nothing) == Scale(0.0, 1.0)
    numbers = dict(zip("abcde", [*nothing, 1.0, 80.0], strict=True))
    scale = value_scale(list(numbers.values()))
    assert scale.kind == "log"
    assert scale.low > 1e-3
    assert len(places(page_picture(panel(scale, Row("a", LOOK, numbers), n=5)))) == len(numbers)


def test_a_picture_that_fails_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(panels, "page_figure", lambda _: {}["<no>"])
    picture = page_picture(panel(Scale(0.0, 1.0), Row("a", LOOK, {"a": 1.0}), n=1))
    assert picture.startswith("<p>Not drawn: internal error in report (Thumb &lt;1&gt;: KeyError")
    assert len(taken_failures()) == 1
    assert taken_failures() == []
