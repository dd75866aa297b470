"""Pictures of a posed hand: joints where they are, and a gross failure shrinks nothing."""

from __future__ import annotations

from itertools import combinations
from xml.etree import ElementTree

import numpy as np
from report_samples.made_study import HOSTILE

from shukotsu.stages.report.belief import BELIEVED, NOT
from shukotsu.stages.report.hand_motion import Chain, DrawnPoint
from shukotsu.stages.report.plots.hand import Box, free_place, hand_panel, window_of
from shukotsu.stages.report.plots.page_pictures import page_picture


def picture(title: str, hand: str, chain: Chain, receivers: np.ndarray) -> str:
    window = window_of(receivers, [chain])
    return page_picture(hand_panel("", title, hand, [chain], receivers, window))


def test_far_joint_is_an_arrow_and_shrinks_nothing() -> None:
    """A joint half a metre off changes neither window nor scale; its distance is written at the edge."""
    receivers = np.array([[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]])
    near = DrawnPoint("a", np.array([10.0, 50, 0]), BELIEVED, 5.0)
    far = DrawnPoint("b", np.array([500.0, 40, 0]), NOT, 490.0)
    chains = [Chain("d", ("a", "b"), (near, far))]
    window = window_of(receivers, chains)
    assert window.high_mm[0] < 100
    root = ElementTree.fromstring(picture(HOSTILE, "right", chains[0], receivers))
    assert root.findtext("title") == HOSTILE
    assert "b 490 mm" in [text.text for text in root.iter("text")]


def test_a_joint_not_to_believe_is_marked_and_a_point_without_a_place_left_out() -> None:
    receivers = np.array([[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]])
    doubted = DrawnPoint("ring_dip", np.array([10.0, 50, 0]), NOT, 5.0)
    tip = DrawnPoint("ring_tip", np.array([20.0, 90, 0]), BELIEVED, 0.0)
    chain = Chain("ring", ("ring_mcp", "ring_dip", "ring_tip"), (None, doubted, tip))
    drawn = picture("t", "left", chain, receivers)
    texts = [text.text for text in ElementTree.fromstring(drawn).iter("text")]
    assert {"ring", "from the back", "from the side"} <= set(texts)
    assert drawn.count("var(--no)") >= 2


def test_words_do_not_lie_on_each_other() -> None:
    """Neighbouring fingertips' names, as of two crossing fingers, are moved apart; where all is taken not."""
    taken: list[Box] = []
    box = (0.0, 0.0, 60.0, 40.0)
    for k, words in enumerate(("middle", "ring", "little")):
        free_place(words, (30.0 + k, 20.0), "center", box, taken)
    for one, other in combinations(taken, 2):
        assert one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
    assert free_place("ring", (30.0, 20.0), "center", box, [box]) == (30.0, 20.0)
