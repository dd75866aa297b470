"""Pictures of subjects as dots: every number is drawn where it belongs, and none hides another uncounted."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.report.palette import MODELS, Look
from stages.report.pictures.subject_dots import (
    MOST_NAMED,
    Panel,
    Strip,
    difference_scale,
    draw_panels,
    spread,
    value_scale,
)

LOOK = Look(MODELS[0], "s")
NUMBERS = st.lists(st.floats(-500.0, 500.0).map(lambda value: round(value, 3)), min_size=1, max_size=40)


def places(picture: str) -> np.ndarray:
    """Where the dots of a picture are, (n, 2), px."""
    return np.array(re.findall(r"M([\d.]+)[ ]?([\d.]+)h0", picture), float).reshape(-1, 2)


@given(st.lists(st.floats(0, 250), max_size=60), st.sampled_from([2.8, 6.0]), st.sampled_from([3, 19]))
def test_no_dot_hides_another_uncounted(values: list[float], diameter: float, most: int) -> None:
    """Dots are apart or counted as overlapping, within the lanes that there are, and in the row's middle."""
    x = np.array(values)
    y, overlapping = spread(x, diameter, most)
    assert np.ptp(y) <= (most - 1) * diameter + 1e-9 if len(y) else True
    assert abs(y.max(initial=0.0) + y.min(initial=0.0)) < 1e-9
    apart = np.hypot(x[:, None] - x, y[:, None] - y) + np.eye(len(x)) * 1e9
    hidden = int((apart.min(axis=1, initial=1e9) < diameter - 1e-9).sum())
    assert (hidden > 0) == (overlapping > 0)
    assert (spread(x, diameter, most)[0] == y).all()


@given(NUMBERS)
def test_scales_hold_every_number(values: list[float]) -> None:
    """Differences all, errors all but those that are counted."""
    numbers = np.array(values)
    for scale, shown in (
        (difference_scale(numbers), numbers),
        (value_scale(np.abs(numbers)), np.abs(numbers)),
    ):
        assert ((shown < scale.low) | (shown > scale.high)).sum() == scale.below(shown)
    assert difference_scale(numbers).low < 0 < difference_scale(numbers).high


@pytest.mark.parametrize("gross", [4.0, 150.0, 9000.0])
def test_gross_failures_flatten_nothing(gross: float) -> None:
    """The usual numbers keep a good part of the axis beside one of centimetres; ticks do not touch."""
    usual = np.linspace(1.0, 3.0, 30)
    errors, differences = value_scale(np.append(usual, gross)), difference_scale(np.append(usual - 2, -gross))
    assert (errors.kind, differences.kind) == (("linear",) * 2 if gross < 10 else ("log", "asinh"))
    assert np.ptp(errors.share(usual)) > 0.1
    assert np.ptp(differences.share(usual - 2)) > 0.1
    assert 0.0 in differences.ticks()
    for scale in (errors, differences):
        assert len(scale.ticks()) >= 2
        assert np.diff(scale.share(scale.ticks())).min() > 0.06


def test_a_scale_of_nothing() -> None:
    """Only zeros, which a model may well have against itself."""
    assert value_scale(np.zeros(3)).share(np.zeros(1)).tolist() == [0.0]
    assert difference_scale(np.zeros(3)).share(np.zeros(1)).tolist() == [0.5]
    assert value_scale(np.array([0.0, 0.0, 3.0])).below(np.array([0.0, 0.0, 3.0])) == 2


@pytest.mark.parametrize("n", [3, MOST_NAMED + 1])
def test_every_subject_is_drawn(n: int) -> None:
    """A dot a number, over its value; subjects are named while they are few."""
    scale = value_scale(np.arange(1.0, n + 1))
    strips = [
        Strip("a & b", LOOK, {f"S{k}": k + 1.0 for k in range(n)}),
        Strip("c", LOOK, {"S0": 1.0}),
        Strip("none", LOOK, {}),
    ]
    (picture,) = draw_panels([Panel("Thumb", "Thumb <1>", strips)], scale, "mm", n).pictures
    found = places(picture)
    assert len(found) == n + 1
    assert picture.count("<title>S") == (n if n <= MOST_NAMED else 0)
    row = np.sort(found[found[:, 1] < found[:, 1].max() - 8][:, 0])
    along = scale.share(np.arange(1.0, n + 1))
    np.testing.assert_allclose(row, np.polyval(np.polyfit(along, row, 1), along), atol=0.1)
    assert f">1 of {n}<" in picture
    assert f">0 of {n}<" in picture
    assert "a &amp; b" in picture
    assert "Thumb &lt;1&gt;" in picture


def test_dots_stand_over_their_numbers() -> None:
    """Where the grid has its line for the number, and the number is written below that."""
    panel = Panel("Thumb", "Thumb", [Strip("one", LOOK, {"S0": 4.0})])
    (picture,) = draw_panels([panel], value_scale(np.array([0.0, 10.0])), "mm", 1).pictures
    written = {
        text: float(x) for x, text in re.findall(r'<text[^>]* x="([\d.]+)"[^>]*>(\d+)</text>', picture)
    }
    assert places(picture)[0, 0] == pytest.approx(written["4"], abs=0.11)


def test_rows_have_room_for_the_most_crowded_panel() -> None:
    """Rows are as high in every panel, and no dot leaves its own."""
    same = {f"S{k}": 5.0 for k in range(9)}
    apart = {name: 10.0 * k for k, name in enumerate(same)}
    panels = [
        Panel("Thumb", f"Thumb {k}", [Strip("one", LOOK, crowded), Strip("two", LOOK, apart)])
        for k, crowded in enumerate((same, apart))
    ]
    pictures = draw_panels(panels, value_scale(np.array([1.0, 100.0])), "mm", 9).pictures
    rows = [
        [float(y) for y in re.findall(r'class="model">.*? y="([\d.]+)"', picture)] for picture in pictures
    ]
    assert rows[0] == rows[1]
    border = 110.0
    assert (places(pictures[0])[:, 1] < border).sum() == 9
