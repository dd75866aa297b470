"""The picture of a hand: joints where they are, and a gross failure shrinks nothing."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
from report_samples.made_study import HOSTILE

from shukotsu.stages.report.belief import BELIEVED, CARE, NOT
from shukotsu.stages.report.hand_motion import BoneLine, HandMotion, ShownSkeleton
from shukotsu.stages.report.plots.hand import hand_panel
from shukotsu.stages.report.plots.panels import page_figure, page_picture

POINTS = ("ring_mcp", "ring_dip", "ring_tip", "little_mcp", "little_dip", "little_tip")
PLACES = np.array([[0.0, 20, 0], [2, 60, 0], [4, 90, 0], [20, 20, 0], [12, 60, 0], [6, 90, 0]])


def motion(hand: str = "right", places: np.ndarray = PLACES) -> HandMotion:
    """Two fingers whose tips lie on each other, in the view's own axes."""
    bones = tuple(BoneLine(i, i + 1, i // 3, i % 3, shared=False) for i in (0, 1, 3, 4))
    skeleton = ShownSkeleton(
        "m", 0, POINTS, places[None], None, np.ones(6), (BELIEVED, NOT, BELIEVED, CARE, BELIEVED, BELIEVED),
        bones, (), np.zeros((1, 2)),
    )  # fmt: skip
    receivers = np.array([[[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]]])
    turned = np.tile([1.0, 0, 0, 0], (1, 3, 1))
    return HandMotion(
        hand, ("ring", "little"), np.zeros(1, np.int64), np.zeros(1), 1, ("hand", "a", "b"), receivers,
        turned, 0, (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (skeleton,),
    )  # fmt: skip


def picture(of: HandMotion, title: str = "t") -> str:
    return page_picture(hand_panel(title, of, of.skeletons[0], 0))


def texts(drawn: str) -> list[str | None]:
    return [text.text for text in ElementTree.fromstring(drawn.replace("xlink:href", "href")).iter("text")]


def test_a_far_joint_is_named_and_shrinks_nothing() -> None:
    places = PLACES.copy()
    places[1, 0] = 500.0
    near, far = motion(), motion(places=places)
    heights = [hand_panel("", of, of.skeletons[0], 0).height_mm for of in (near, far)]
    assert heights[1] - heights[0] < 4.0, "a line of words"
    assert "Not in the picture: ring_dip." in texts(picture(far))
    assert "var(--no)" not in picture(far)


def test_joints_are_marked_by_verdict_and_a_title_is_text() -> None:
    drawn = picture(motion("left"), HOSTILE)
    assert ElementTree.fromstring(drawn.replace("xlink:href", "href")).findtext("title") == HOSTILE
    assert {"ring", "little", "from the back", "from the side", "20 mm"} <= set(texts(drawn))
    assert "var(--no)" in drawn
    assert "var(--amber)" in drawn


def test_no_hand_is_mirrored() -> None:
    """From the side the back of a right hand is to the right, that of a left one to the left."""
    for hand, sign in (("right", 1), ("left", -1)):
        places = PLACES.copy()
        places[1, 2] = 10.0
        of = replace(motion(hand, places))
        axes = page_figure(hand_panel("", of, of.skeletons[0], 0)).axes[0]
        bones = [line.get_xdata() for line in axes.lines if line.get_linewidth() == 2.2]
        start, end = np.asarray(bones[4], float)  # the first bone in the second view
        assert np.sign(end - start) == sign


def test_names_of_crossing_fingers_do_not_lie_on_each_other() -> None:
    axes = page_figure(hand_panel("", motion(), motion().skeletons[0], 0)).axes[0]
    names = [text for text in axes.texts if text.get_text() in ("ring", "little")]
    for one, other in combinations(names, 2):
        (x, y), (x2, y2) = one.get_position(), other.get_position()
        assert abs(x - x2) > 8.0 or abs(y - y2) > 3.0
