"""Panels: numbers and joints are drawn at their positions, and scales withstand gross failures."""

import re
from functools import partial
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_samples.made_study import HOSTILE

from shukotsu.report.belief import BELIEVED, CARE, NOT
from shukotsu.report.figures import drawing
from shukotsu.report.figures.drawing import Panel, PanelRow, Scale
from shukotsu.report.hand_motion import BoneLine, HandMotion, ShownSkeleton
from shukotsu.report.palette import MODELS, Look

LOOK = Look(MODELS[0], "s")
NUMBERS = st.lists(st.floats(-500.0, 500.0).map(lambda value: round(value, 3)), min_size=1, max_size=40)
POINTS = ("ring_mcp", "ring_dip", "ring_tip", "little_mcp", "little_dip", "little_tip")
POINTS_MM = np.array([[0.0, 20, 0], [2, 60, 0], [4, 90, 0], [20, 20, 0], [12, 60, 0], [6, 90, 0]])


def dots(picture: str) -> np.ndarray:
    """Return the positions (n, 2) of the dots in a picture."""
    uses = re.findall(r'<use xlink:href="#\w+" x="([\d.]+)" y="([\d.]+)" style="[^"]*opacity', picture)
    return np.array(uses, float).reshape(-1, 2)


def panel(scale: Scale, *rows: PanelRow, n: int) -> Panel:
    draw = partial(drawing.draw_rows, rows=rows, axis="mm", scale=scale, of_all=n)
    return Panel("", "Thumb <1>", 3.6 * (len(rows) + 1), 9.0, draw)


@given(NUMBERS)
def test_scales_include_every_number(values: list[float]) -> None:
    """A logarithmic scale may omit numbers below 1e-4 of its upper end."""
    numbers = np.abs(values)
    scale = drawing.value_scale(numbers)
    assert scale.high >= numbers.max()
    assert scale.low <= max(numbers[numbers != 0].min(initial=500.0), scale.high / 1e4)


@pytest.mark.parametrize(("gross", "kind"), [(4.0, "linear"), (150.0, "log"), (9000.0, "log")])
def test_gross_failures_do_not_compress_the_usual_numbers(gross: float, kind: str) -> None:
    """With a gross value of centimetres the scale becomes logarithmic, so that the usual numbers stay
    readable.
    """
    assert drawing.value_scale(np.append(np.linspace(1.0, 3.0, 30), gross)).kind == kind


@pytest.mark.parametrize(
    ("scale", "expected"),
    [
        (Scale(0.0, 9.3), [0, 2, 4, 6, 8]),
        (Scale(0.8, 9.0, "log"), [1, 2, 5]),
        (Scale(0.4, 300.0, "log"), [1, 3, 10, 30, 100, 300]),
    ],
)
def test_ticks_are_round_numbers(scale: Scale, expected: list[float]) -> None:
    ticks = drawing.locator(scale).tick_values(scale.low, scale.high)
    assert [tick for tick in ticks if scale.low <= tick <= scale.high] == pytest.approx(expected)


def test_every_subject_has_a_dot_at_its_value() -> None:
    """Dots are spaced like their values, rows with missing subjects state n, and the picture is
    reproducible.
    """
    first = PanelRow("a & b", LOOK, {f"S{k}": k + 1.0 for k in range(31)})
    drawn = panel(
        drawing.value_scale(np.arange(1.0, 32)),
        first,
        PanelRow("c", LOOK, {"S0": 1.0}),
        PanelRow("d", LOOK),
        n=31,
    )
    picture = drawing.page_picture(drawn)
    assert picture == drawing.page_picture(drawn)
    places = dots(picture)
    assert len(places) == 32
    row, along = np.sort(places[places[:, 1] < places[:, 1].min() + 7][:, 0]), np.arange(1.0, 32)
    np.testing.assert_allclose(row, np.polyval(np.polyfit(along, row, 1), along), atol=0.1)
    for text in (">1.0 (n = 1)<", "a &amp; b", "Thumb &lt;1&gt;"):
        assert text in picture


def test_rounding_errors_do_not_stretch_a_scale() -> None:
    """Numbers of rounding size alone give the unit scale; beside a gross number they are drawn at its lower
    end.
    """
    nothing = [9e-15, 2e-13, 0.0]
    assert drawing.value_scale(nothing) == Scale(0.0, 1.0)
    numbers = dict(zip("abcde", [*nothing, 1.0, 80.0], strict=True))
    scale = drawing.value_scale(list(numbers.values()))
    assert scale.kind == "log"
    assert scale.low > 1e-3
    assert len(dots(drawing.page_picture(panel(scale, PanelRow("a", LOOK, numbers), n=5)))) == len(numbers)


def motion(hand: str = "right", points_mm: np.ndarray = POINTS_MM) -> HandMotion:
    """Return a motion of two fingers whose tips overlap, in the view's axes."""
    bones = tuple(BoneLine(i, i + 1, i // 3, i % 3, shared=False) for i in (0, 1, 3, 4))
    believed = (BELIEVED, NOT, BELIEVED, CARE, BELIEVED, BELIEVED)
    skeleton = ShownSkeleton(
        "m", 0, POINTS, points_mm[None], None, np.ones(6), believed, bones, (), np.zeros((1, 2))
    )
    receivers = np.array([[[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]]])
    turned = np.tile([1.0, 0, 0, 0], (1, 3, 1))
    return HandMotion(
        hand, ("ring", "little"), np.zeros(1, np.int64), np.zeros(1), 1, ("hand", "a", "b"), receivers,
        turned, 0, np.eye(3), (skeleton,),
    )  # fmt: skip


def hand(of: HandMotion, title: str = "t") -> Panel:
    return drawing.hand_panel(title, of, of.skeletons[0], 0)


def test_a_far_joint_is_named_and_does_not_shrink_the_picture() -> None:
    points_mm = POINTS_MM.copy()
    points_mm[1, 0] = 500.0
    near, far = hand(motion()), hand(motion(points_mm=points_mm))
    assert far.height_mm - near.height_mm < 4.0, "only by a line of text"
    assert ">Not shown: ring_dip.</text>" in drawing.page_picture(far)
    assert "var(--no)" not in drawing.page_picture(far)


def test_joints_are_coloured_by_verdict_and_titles_are_escaped() -> None:
    drawn = drawing.page_picture(hand(motion("left"), HOSTILE))
    root = ElementTree.fromstring(drawn.replace("xlink:href", "href"))
    assert root.findtext("title") == HOSTILE
    assert {"ring", "little", "from the back", "from the side", "20 mm"} <= {
        e.text for e in root.iter("text")
    }
    assert "var(--no)" in drawn
    assert "var(--amber)" in drawn


@pytest.mark.parametrize(("side", "sign"), [("right", 1), ("left", -1)])
def test_neither_hand_is_drawn_mirrored(side: str, sign: int) -> None:
    """In the side view the back of the hand is on the right for a right hand, on the left for a left hand."""
    points_mm = POINTS_MM.copy()
    points_mm[1, 2] = 10.0
    axes = drawing.page_figure(hand(motion(side, points_mm))).axes[0]
    bones = [line.get_xdata() for line in axes.lines if line.get_linewidth() == 2.2]
    start, end = np.asarray(bones[2], float)[:2]  # the first bone of the first digit in the second view
    assert np.sign(end - start) == sign


def test_names_of_crossing_fingers_do_not_overlap() -> None:
    axes = drawing.page_figure(hand(motion())).axes[0]
    names = [text for text in axes.texts if text.get_text() in ("ring", "little")]
    for (x, y), (x2, y2) in combinations([name.get_position() for name in names], 2):
        assert abs(x - x2) > 8.0 or abs(y - y2) > 3.0
