"""Pictures of a posed hand: joints where they are, and a gross failure shrinks nothing."""

from __future__ import annotations

from itertools import combinations
from xml.etree import ElementTree

import numpy as np
from report_samples.made_study import HOSTILE

from stages.report.belief import BELIEVED, CARE, NOT
from stages.report.hand_motion import Chain, Point
from stages.report.pictures.hand_index import IndexEntry, hand_index
from stages.report.pictures.hand_views import free_place, hand_picture, window_of
from stages.report.pictures.word_places import LETTER_PX, LINE_PX, Labels


def test_far_joint_is_an_arrow_and_shrinks_nothing() -> None:
    """A joint half a metre off changes neither window nor scale; its distance is written at the edge."""
    receivers = np.array([[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]])
    near = Point("a", np.array([10.0, 50, 0]), BELIEVED, 5.0)
    far = Point("b", np.array([500.0, 40, 0]), NOT, 490.0)
    chains = [Chain("d", ("a", "b"), (near, far))]
    window = window_of(receivers, chains)
    assert window.high_mm[0] < 100
    root = ElementTree.fromstring(hand_picture(HOSTILE, "right", chains, receivers, window, 1.0))
    assert root.findtext("title") == HOSTILE
    assert "b 490 mm" in [text.text for text in root.iter("text")]


def test_a_joint_not_to_believe_is_named_and_a_point_without_a_place_left_out() -> None:
    receivers = np.array([[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]])
    doubted = Point("ring_dip", np.array([10.0, 50, 0]), NOT, 5.0)
    tip = Point("ring_tip", np.array([20.0, 90, 0]), BELIEVED, 0.0)
    chains = [Chain("ring", ("ring_mcp", "ring_dip", "ring_tip"), (None, doubted, tip))]
    picture = hand_picture("t", "left", chains, receivers, window_of(receivers, chains), 2.0)
    texts = [text.text for text in ElementTree.fromstring(picture).iter("text")]
    assert {"ring", "ring_dip"} <= set(texts)
    assert "back of the hand to the left" in texts
    assert picture.count("var(--no)") >= 2


def test_the_index_has_a_link_for_every_joint() -> None:
    """Those without a place, or outside of the window, too; each with the mark that says how sure it is."""
    receivers = np.array([[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]])
    mcp = Point("ring_mcp", np.array([10.0, 50, 0]), CARE, 5.0)
    tip = Point("ring_tip", np.array([20.0, 90, 0]), BELIEVED, 0.0)
    chains = [Chain("ring", ("ring_mcp", "ring_dip", "ring_tip"), (mcp, None, tip))]
    entries = {
        "ring_mcp": IndexEntry(CARE, "#mcp", "ring_mcp: <with care>"),
        "ring_dip": IndexEntry(NOT, "#dip", "ring_dip: no"),
    }
    root = ElementTree.fromstring(hand_index("t", "left", chains, window_of(receivers, chains), entries))
    links = {link.get("href"): link for link in root.iter("a")}
    assert {href: link.get("aria-label") for href, link in links.items()} == {
        "#mcp": "ring_mcp: <with care>",
        "#dip": "ring_dip: no",
    }
    drawn = {href: ElementTree.tostring(link, "unicode") for href, link in links.items()}
    assert "var(--amber)" in drawn["#mcp"]
    assert "var(--no)" in drawn["#dip"]
    assert "outside the picture, or without a place" in [text.text for text in root.iter("text")]


def test_words_do_not_lie_on_each_other() -> None:
    """Neighbouring fingertips' names, as of two crossing fingers, are moved apart, and stay inside."""
    labels = Labels(0.0, 200.0)
    places = [labels.place(words, 100.0 + k, 50.0) for k, words in enumerate(("middle", "ring", "little"))]
    boxes = [(x, y, LETTER_PX * n / 2) for (x, y), n in zip(places, (6, 4, 6), strict=True)]
    for one, other in combinations(boxes, 2):
        assert abs(one[0] - other[0]) >= one[2] + other[2] or abs(one[1] - other[1]) >= LINE_PX


def test_labels_keep_apart() -> None:
    """A label goes to the nearest free place, or to its own where all are taken."""
    assert free_place(50.0, range(0, 100, 5), 10.0, 100.0) == 50.0
    assert abs(free_place(50.0, [50.0], 10.0, 100.0) - 50.0) == 10.0
