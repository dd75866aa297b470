"""Charts and pictures: what is drawn is what is there, where it is."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from report_samples.made_study import HOSTILE, hand_points

from schemas.layout import read_layout
from schemas.model import read_model
from stages.report.error_chart import error_chart, error_scale
from stages.report.hand_picture import hand_picture, window_of
from stages.report.posed_skeleton import Chain, Point, middle_posture, receiver_points, skeleton_chains
from stages.report.study_results import StudyResults
from stages.report.svg import element, free_place
from stages.report.tip_traces import Trace, thin


def _trace(error: np.ndarray, columns: int = 240) -> Trace:
    n = len(error)
    trace = thin(np.arange(n, dtype=float), np.full(n, np.nan), error, columns)
    assert trace is not None
    return trace


def test_thinning_keeps_every_columns_extremes() -> None:
    """The largest and smallest errors survive; there are at most as many columns as asked for."""
    error = np.random.default_rng(1).gamma(2.0, 1.0, 5000)
    trace = _trace(error, 100)
    assert len(trace.x) == 100
    expected = error.reshape(100, 50)
    np.testing.assert_array_equal(trace.low_mm, expected.min(axis=1))
    np.testing.assert_array_equal(trace.high_mm, expected.max(axis=1))
    np.testing.assert_array_equal(trace.rises, expected[:, 0] <= expected[:, -1])


@pytest.mark.parametrize(("n", "gap", "breaks"), [(50, slice(20, 21), 1), (5000, slice(100, 101), 0)])
def test_gaps_that_can_be_seen_stay(n: int, gap: slice, breaks: int) -> None:
    """One missing frame breaks a line of few frames; of thousands it is narrower than a pixel."""
    error = np.ones(n)
    error[gap] = np.nan
    assert _trace(error).broken.sum() == breaks


def test_gap_longer_than_a_column_stays() -> None:
    """A second without data is a gap in the line, drawn as a new start."""
    error = np.ones(5000)
    error[1000:1240] = np.nan
    trace = _trace(error)
    assert trace.broken.sum() == 1
    assert trace.x[trace.broken][0] == 1240
    drawing = str(error_chart("t", ("a",), {"a": trace}, error_scale([trace])))
    (line,) = [e for e in ElementTree.fromstring(drawing).iter("path") if e.get("class") == "line digit0"]
    assert line.attrib["d"].count("M") == 2


def test_series_without_an_error_has_no_trace() -> None:
    """Nothing valid, nothing drawn; one frame is enough for a point."""
    nothing = np.array([np.nan])
    assert thin(np.zeros(1), nothing, nothing) is None
    assert len(_trace(np.ones(1)).x) == 1


def test_gross_failure_makes_the_scale_logarithmic() -> None:
    """Digits that differ little share a scale from zero."""
    small, large = _trace(np.full(10, 2.0)), _trace(np.full(10, 80.0))
    assert error_scale([small, large]).logarithmic
    assert not error_scale([small, _trace(np.full(10, 3.0))]).logarithmic
    assert error_scale([]).high_mm > 0


@pytest.mark.parametrize("hand", ["right", "left"])
def test_skeleton_is_where_the_joints_are(results: StudyResults, hand: str) -> None:
    """Child-side and parent-side joints, seen from the back: distal up, the thumb on its own side."""
    layout, model = read_layout("liberty16"), read_model("paper-fig4-corrected")
    own = next(h for h in results.study.hands if (h.subject, h.hand) == ("S01", hand))
    recording = results.study.evaluated(own)[0]
    posture = middle_posture(results.paths.poses(recording), layout)
    assert posture is not None
    rows = {row["joint"]: row for row in results.joints_of[own, model.name]}
    centres, _ = hand_points(hand)
    for chain in skeleton_chains(layout, model, rows, posture):
        for point in chain.points:
            if point is not None and point.name in centres:
                x, y, z = centres[point.name]
                np.testing.assert_allclose(point.position_mm, (-y, x, z), atol=0.5)
    thumb = next(c for c in skeleton_chains(layout, model, rows, posture) if c.digit == "thumb").points[-1]
    assert thumb is not None
    assert (thumb.position_mm[0] < 0) == (hand == "right")


def test_frame_is_the_fullest_nearest_the_middle(results: StudyResults) -> None:
    """The index receiver is lost in frames 100 to 159, so the frame drawn is the next one."""
    recording = results.study.recordings[0]
    posture = middle_posture(results.paths.poses(recording), read_layout("liberty16"))
    assert posture is not None
    assert posture.frame == 160
    assert len(receiver_points(read_layout("liberty16"), posture)) == 16


def test_far_joint_is_an_arrow_and_shrinks_nothing() -> None:
    """A joint half a metre off changes neither window nor scale; its distance is written at the edge."""
    receivers = np.array([[0.0, 0, 0], [60, 100, 0], [-40, 150, 10]])
    near = Point("a", np.array([10.0, 50, 0]), "ok", 5.0)
    far = Point("b", np.array([500.0, 40, 0]), "weak", 490.0)
    window = window_of(receivers, [Chain("d", ("a", "b"), (near, far))])
    assert window.high_mm[0] < 100
    drawing = hand_picture(HOSTILE, "right", [Chain("d", ("a", "b"), (near, far))], receivers, window, 1.0)
    root = ElementTree.fromstring(str(drawing))
    assert root.findtext("title") == HOSTILE
    assert "b 490 mm" in [text.text for text in root.iter("text")]


def test_elements_escape_everything() -> None:
    """Text and values are text and values, whatever is in them."""
    drawn = element("text", "</text><script>", class_='"><b>', stroke_width=1.25)
    root = ElementTree.fromstring(str(drawn))
    assert root.text == "</text><script>"
    assert root.attrib == {"class": '"><b>', "stroke-width": "1.2"}


def test_labels_keep_apart() -> None:
    """A label goes to the nearest free place, or to its own where all are taken."""
    assert free_place(50.0, range(0, 100, 5), 10.0, 0.0, 100.0) == 50.0
    assert abs(free_place(50.0, [50.0], 10.0, 0.0, 100.0) - 50.0) == 10.0
