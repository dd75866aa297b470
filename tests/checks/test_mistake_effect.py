"""The effect of undoing a mistake on gaps, joint centres and the hand's scale."""

from dataclasses import replace

import numpy as np

from benchmarks.mistakes import MISTAKES, Planted
from shukotsu.checks.expected_body import expected_body
from shukotsu.checks.mistake_search import effect, explain_joints
from shukotsu.hand.sampled_motion import motion_of, receiver_axes
from shukotsu.study.findings import Finding
from shukotsu.study.layout import read_layout

LAYOUT = read_layout("liberty16")


def finding_of(planted: Planted, name: str) -> Finding:
    (finding,) = MISTAKES[name][1](planted, np.random.default_rng(3)).findings()
    return finding


def test_undoing_a_mistake_of_all_receivers_moves_and_closes_every_joint(planted: Planted) -> None:
    values = finding_of(planted, "one axis negated").values
    assert (values["effect"], values["moved"], values["joints"]) == ("closer", 15, 15)
    assert values["gap_before_mm"] > 5 > 2 > values["gap_after_mm"]
    assert values["scale_before"] < 0.6 < 0.9 < values["scale_after"] < 1.2


def test_undoing_a_mistake_of_one_receiver_reports_its_joints_only(planted: Planted) -> None:
    values = finding_of(planted, "a receiver on the other side all along").values
    assert (values["effect"], values["moved"], values["joints"]) == ("closer", 1, 1)
    assert values["gap_before_mm"] > 50 > 2 > values["gap_after_mm"]


def test_without_a_mistake_or_only_mirrored_no_joint_moves(planted: Planted) -> None:
    body = expected_body(LAYOUT, planted.poses.segments)
    poses, axes = planted.poses, receiver_axes(LAYOUT, planted.poses.segments)
    motion = motion_of(poses.position_mm, poses.quaternion, poses.valid, axes, planted.hand)
    clean = explain_joints(motion, body)
    mirrored = replace(clean, motion=motion.mirrored(), centre_mm=clean.centre_mm * [1, -1, 1])
    for values in (effect(body, clean, clean), effect(body, clean, mirrored, other_hand=True)):
        assert (values["effect"], values["moved"]) == ("none", 0)
    assert effect(body, clean, mirrored)["moved"] == 15
