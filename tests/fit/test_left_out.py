"""Frames left out of a calibration because receivers were displaced, and the receivers table about it."""

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from simulated_poses import fitted, recorded

from shukotsu.fit.field_test import Disturbance
from shukotsu.fit.fingertips import fingertips
from shukotsu.fit.fit import HandFit
from shukotsu.fit.hand_tables import receiver_rows
from shukotsu.fit.left_out import Unsteady, share_left_out, without_displaced
from shukotsu.fit.loose_receivers import Displaced, LooseReceiver, Moment
from shukotsu.tables.poses import RecordingName


def made_loose(segment: str, recording: int, frame: int) -> LooseReceiver:
    moment = Moment(recording, frame, float("nan"))
    return LooseReceiver(segment, moment, moment, np.array([5.0, 0.0, 0.0, 0.0, 0.1, 0.0]))


def test_the_longest_part_between_displacements_is_kept() -> None:
    """It may lie before, after or between two moments and run over recordings; one may lack the receiver."""
    poses = recorded(seed=5, n_frames=600)[1]
    valid = poses.valid.copy()
    valid[:450, poses.index("hand")] = False
    first, second = replace(poses, valid=valid), poses
    loose = [
        made_loose("index_distal", 0, 401),
        made_loose("ring_middle", 0, 101),
        made_loose("ring_middle", 1, 501),
        made_loose("hand", 1, 201),
    ]
    kept = without_displaced(cast("HandFit", None), [first, second], Displaced(loose))
    expected = np.array(
        [
            [np.arange(600) < 0, np.ones(600, bool)],
            [np.arange(600) >= 100, np.arange(600) < 500],
            [np.arange(600) < 0, np.arange(600) >= 200],
        ]
    )
    expected[0, 0, 400:] = True
    for segment, parts in zip(("index_distal", "ring_middle", "hand"), expected, strict=True):
        for poses, part in zip(kept, parts, strict=True):
            np.testing.assert_array_equal(poses.valid[:, poses.index(segment)], part)
    for before, after in zip((first, second), kept, strict=True):
        others = ~np.isin(before.segments, [receiver.segment for receiver in loose])
        np.testing.assert_array_equal(after.valid[:, others], before.valid[:, others])
        assert after.position_mm is before.position_mm
    assert share_left_out([first, second], kept) == {
        "index_distal": pytest.approx(400 / 1200),
        "ring_middle": pytest.approx(200 / 1200),
        "hand": pytest.approx(350 / 750),
    }


def test_receiver_rows_report_displacements_and_the_frames_left_out() -> None:
    left = fitted("left")
    tips, names = fingertips(left), [RecordingName("01", "left", "rom", "2")]
    step = np.array([0.0, 8.0, 0.0, 0.1, 0.0, 0.0])
    slid = LooseReceiver("hand", Moment(0, 720, 3.0), Moment(0, 5040, 21.0), step)
    fell = LooseReceiver("ring_middle", Moment(0, 99, np.nan), Moment(0, 99, np.nan), step)
    unsteady = Unsteady(names, Displaced([slid, fell]), {}, {"hand": 0.25})
    rows = {row["segment"]: row for row in receiver_rows(tips, unsteady)}
    assert rows["hand"]["message"] == (
        "slid in rom, 2 between 3.0 s and 21.0 s: it moved 8.0 mm and turned 6 deg on its bone; "
        "25 % of its frames were left out"
    )
    assert rows["ring_middle"]["message"] == (
        "came loose in rom, 2 at frame 99: it moved 8.0 mm and turned 6 deg on its bone; "
        "all of its frames were used, as this moves no joint centre by more than its error"
    )
    kinds = [rows[name]["loose_kind"] for name in ("hand", "ring_middle", "index_middle")]
    assert kinds == ["slide", "step", ""]
    assert (rows["hand"]["loose_from_frame"], rows["hand"]["loose_until_frame"]) == (720, 5040)
    poses = recorded("left", seed=4, n_frames=1600)[1]
    tip_mm = poses.position_mm[0, poses.index("little_distal")]  # the metal is 10 mm beside it
    nearest = left.convention.world(np.eye(3), tip_mm)[1]
    field = Disturbance(
        nearest + np.array([0.0, 10.0, 0.0]), nearest, np.array([6.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    )
    near = Unsteady(names, Displaced(field=field), {"little_distal": field.error}, {})
    row = {row["segment"]: row for row in receiver_rows(tips, near)}["little_distal"]
    np.testing.assert_allclose([row[f"field_{axis}_mm"] for axis in "xyz"], tip_mm)
    where = ", ".join(f"{value:.0f}" for value in tip_mm)
    assert row["message"].startswith(
        f"the field is disturbed near ({where}) mm, probably by metal: this receiver's error there is 6.0"
    )
