"""Pictures of a posed hand: joints where they are, and a gross failure shrinks nothing."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from report_samples.made_study import HOSTILE

from stages.report.hand_motion import Chain, Point
from stages.report.pictures.hand_views import free_place, hand_picture, window_of


def test_far_joint_is_an_arrow_and_shrinks_nothing() -> None:
    """A joint half a metre off changes neither window nor scale; its distance is written at the edge."""
    receivers = np.array([[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]])
    near = Point("a", np.array([10.0, 50, 0]), "ok", 5.0)
    far = Point("b", np.array([500.0, 40, 0]), "weak", 490.0)
    chains = [Chain("d", ("a", "b"), (near, far))]
    window = window_of(receivers, chains)
    assert window.high_mm[0] < 100
    root = ElementTree.fromstring(hand_picture(HOSTILE, "right", chains, receivers, window, 1.0))
    assert root.findtext("title") == HOSTILE
    assert "b 490 mm" in [text.text for text in root.iter("text")]


def test_a_doubtful_joint_is_named_and_a_point_without_a_place_left_out() -> None:
    receivers = np.array([[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]])
    weak = Point("ring_dip", np.array([10.0, 50, 0]), "weak", 5.0)
    tip = Point("ring_tip", np.array([20.0, 90, 0]), "ok", 0.0)
    chains = [Chain("ring", ("ring_mcp", "ring_dip", "ring_tip"), (None, weak, tip))]
    picture = hand_picture("t", "left", chains, receivers, window_of(receivers, chains), 2.0)
    texts = [text.text for text in ElementTree.fromstring(picture).iter("text")]
    assert {"ring", "dip"} <= set(texts)
    assert "back of the hand to the left" in texts
    assert picture.count("var(--amber)") >= 2


def test_labels_keep_apart() -> None:
    """A label goes to the nearest free place, or to its own where all are taken."""
    assert free_place(50.0, range(0, 100, 5), 10.0, 100.0) == 50.0
    assert abs(free_place(50.0, [50.0], 10.0, 100.0) - 50.0) == 10.0
