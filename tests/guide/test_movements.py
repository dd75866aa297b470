"""The movements that the guide shows: as far as it asks for, the right way round, pad on pad."""

import re
from pathlib import Path

import numpy as np
import pytest

from anatomy import average_hand
from guide.average_joints import average_joints, posed
from guide.flesh import flesh_of
from guide.movements import movements
from guide.views import View
from skeleton.rotations import rotate
from stages.simulate.random_hand import ABDUCTION, BONES, DIGITS, FLEXION, JOINTS, TIP_BONES
from stages.simulate.task_motion import range_postures, rest_posture
from stages.solve_joints.calibration_advice import WANTED_DEG

PAGE = Path(__file__).parents[2] / "docs" / "calibration-movements.md"
KINDS = {
    "thumb CMC": "cmc",
    "thumb MCP": "thumb_mcp",
    "thumb IP": "ip",
    "MCP": "mcp",
    "PIP": "pip",
    "DIP": "dip",
}
SHOWN_BY = {
    "thumb CMC": "thumb-circle",
    "thumb MCP": "thumb-bend",
    "thumb IP": "thumb-bend",
    "MCP": "knuckles",
    "PIP": "hook",
    "DIP": "fingertips",
}
FINGERS = DIGITS[1:]


def asked_deg() -> dict[str, float]:
    rows = re.findall(r"^\| ([\w ]+?) \| (\d+) \|$", PAGE.read_text("utf-8"), re.MULTILINE)
    return {joint: float(degrees) for joint, degrees in rows}


def joints_of(name: str) -> list[str]:
    kind = name.rpartition(" ")[2].lower()
    return [f"thumb_{kind}"] if name.startswith("thumb") else [f"{finger}_{kind}" for finger in FINGERS]


def test_the_page_asks_for_what_the_advice_asks_for() -> None:
    assert asked_deg() == {name: WANTED_DEG[kind] for name, kind in KINDS.items()}


@pytest.mark.parametrize("name", SHOWN_BY)
def test_each_joint_is_shown_through_the_range_that_is_asked_for(name: str) -> None:
    spans = movements()[SHOWN_BY[name]].ranges_deg()
    assert all(spans[joint][FLEXION] >= asked_deg()[name] for joint in joints_of(name))


def test_only_fingertip_joints_move_where_they_move_alone() -> None:
    frames = movements()["fingertips"].frames
    moved = {JOINTS[j] for j in np.flatnonzero(np.ptp(frames, axis=0).max(-1) > 0)}
    assert moved == {f"{finger}_dip" for finger in FINGERS}


def test_fingers_spread_as_the_simulator_spreads_them_and_close_without_crossing() -> None:
    spread, together = movements()["spread"].postures
    knuckles = [JOINTS.index(f"{finger}_mcp") for finger in FINGERS]
    wanted = range_postures()["spread"][0]
    assert spread[knuckles, ABDUCTION] == pytest.approx(wanted[knuckles, ABDUCTION])
    tips = [BONES.index(f"{finger}_distal") for finger in FINGERS]
    gaps = [-np.diff(posed(each[None])[0][0, tips, 1]) for each in (together, spread)]  # y is to the thumb
    assert (gaps[0] > 8).all()
    assert (gaps[1] > gaps[0] + 3).all()


@pytest.mark.parametrize("movement", movements().values(), ids=movements())
def test_every_movement_is_of_the_joints_that_it_marks(movement) -> None:  # type: ignore[no-untyped-def]
    assert all(span.max() > 5 for span in movement.ranges_deg().values())
    assert bool(movement.ranges_deg()) == movement.moves


def test_pads_meet_in_opposition_finger_after_finger() -> None:
    postures = movements()["opposition"].postures
    position, turn = posed(postures)
    pads = position[:, TIP_BONES] + rotate(turn[:, TIP_BONES], average_joints().pad_mm)
    apart = np.linalg.norm(pads[:, 1:] - pads[:, :1], axis=-1)
    assert apart[::2].argmin(-1).tolist() == [0, 1, 2, 3]
    assert (apart[::2].min(-1) < 6).all()  # pads are soft, and 6 mm deep
    assert (apart[1::2] > 30).all()


def test_the_straight_hand_is_the_average_one() -> None:
    position, _ = posed(np.zeros((1, len(JOINTS), 2)))
    for digit, own in average_hand.DIGITS.items():
        bones = [b for b, name in enumerate(BONES) if name.startswith(f"{digit}_")]
        assert position[0, bones] == pytest.approx(own.joints_mm(), abs=1e-9)


def test_fingers_bend_to_the_palm_and_the_thumb_is_on_the_left_of_a_right_hands_back() -> None:
    hand = flesh_of(*posed(np.array([rest_posture(), rest_posture() + range_postures()["knuckles"][0]])))
    back = View.seen((0, 0, 1), (1, 0, 0), 1.0, (0.0, 0.0))
    tips = {digit: hand.at(f"{digit}_distal", np.zeros(3)) for digit in DIGITS}
    x = [back.px(tips[digit][0])[0] for digit in DIGITS]
    assert x == sorted(x)
    for finger in FINGERS:
        straight, bent = tips[finger]
        assert bent[2] < straight[2] - 30  # z is dorsal


def test_wrist_and_spread_go_both_ways() -> None:
    for name, kind in (("wrist-bend", FLEXION), ("wrist-sideways", ABDUCTION)):
        angle = movements()[name].frames[:, JOINTS.index("wrist"), kind]
        assert angle.min() < -10 < 10 < angle.max()
