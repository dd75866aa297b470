"""The drawn hands: read by the simulator alone, which reads nothing that an estimator reads."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from anatomy.drawn_hands import CT, MIXED, SOURCES, DrawnHand, blended
from skeleton.rotations import Array, unit

ROOT = Path(__file__).parents[2]
ROOMS = ("anatomy", "checks", "schemas", "skeleton", "stages", "trackers", "workflow")


def readers_of(module: str) -> set[str]:
    """Folders of two levels whose modules name the anatomy module."""
    paths = (path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    return {
        "/".join(path.relative_to(ROOT).parts[:2])
        for path in paths
        if path.stem != module and module in path.read_text("utf-8")
    }


def test_no_estimator_reads_whom_the_simulator_draws() -> None:
    assert readers_of("drawn_hands") - {"anatomy/average_hand.py"} == {"stages/simulate"}


@pytest.mark.parametrize("module", ["average_hand", "known_digits", "anatomy.skin"])
def test_the_simulator_reads_nothing_that_estimators_expect(module: str) -> None:
    assert "stages/simulate" not in readers_of(module)


def knuckles_mm(hand: DrawnHand) -> list[Array]:
    """MCP joints of the fingers."""
    fingers = list(hand.values())[1:]
    return [digit.base_mm + digit.lengths_mm[0] * digit.directions[0] for digit in fingers]


def test_the_ct_hand_is_what_its_numbers_say() -> None:
    """176 mm long, its knuckles 20, 17 and 16 mm apart, hinges as oblique and as twisted as measured."""
    middle = CT["middle"]
    length_mm = middle.base_mm[0] + middle.lengths_mm.sum() + middle.soft_tip_mm
    assert length_mm == pytest.approx(176, abs=0.3)
    knuckles = knuckles_mm(CT)
    apart = [np.linalg.norm(a - b) for a, b in pairwise(knuckles)]
    np.testing.assert_allclose(apart, [20, 17, 16], atol=0.1)
    index = CT["index"]
    axis_along = (index.flexion_axes * index.directions).sum(-1)
    np.testing.assert_allclose(np.degrees(np.arcsin(axis_along[2:])), [-5.0, -1.3], atol=0.05)
    square = [axis - (axis @ index.directions[2]) * index.directions[2] for axis in index.flexion_axes[2:]]
    twist = np.cross(unit(square[0]), unit(square[1])) @ index.directions[2]
    assert np.degrees(np.arcsin(twist)) == pytest.approx(11, abs=1.0)
    for name, lean_deg in (("index", -3.2), ("little", 8.0)):
        digit = CT[name]
        assert np.degrees(np.arccos(digit.directions[2] @ digit.directions[3])) == pytest.approx(
            abs(lean_deg)
        )
        assert (digit.directions[3, 1] > digit.directions[2, 1]) == (lean_deg > 0)


@pytest.mark.parametrize("name", SOURCES)
def test_sources_are_hands_of_one_frame_and_one_size(name: str) -> None:
    """Digits in their order from the thumb's side, joints and axes near those of the CT hand."""
    hand = SOURCES[name]
    assert list(hand) == list(CT)
    lateral = [point[1] for point in knuckles_mm(hand)]
    assert lateral == sorted(lateral, reverse=True)
    for digit, ct in zip(hand.values(), CT.values(), strict=True):
        np.testing.assert_allclose(np.linalg.norm(digit.directions, axis=-1), 1.0)
        assert np.linalg.norm(digit.base_mm - ct.base_mm) < 10
        assert (np.abs(digit.lengths_mm / ct.lengths_mm - 1) < 0.2).all()
        alike = (unit(digit.flexion_axes) * unit(ct.flexion_axes)).sum(-1)
        assert (alike[1:] > np.cos(np.radians(25))).all()


def test_the_mixed_table_is_outside_of_all_sources() -> None:
    """Its metacarpals are longer, its fingers shorter than anybody's."""
    for digit, mixed in MIXED.items():
        lengths = np.array([hand[digit].lengths_mm for hand in SOURCES.values()])
        assert mixed.lengths_mm[0] > lengths[:, 0].max()
        assert mixed.lengths_mm[1:].sum() < lengths[:, 1:].sum(-1).min() - 2


def test_a_blend_of_one_hand_is_that_hand_and_of_two_between() -> None:
    hands = [SOURCES["ct"], SOURCES["myohand"]]
    alone, half = blended(hands, [1.0, 0.0]), blended(hands, [0.5, 0.5])
    for name, ct in CT.items():
        np.testing.assert_allclose(alone[name].lengths_mm, ct.lengths_mm)
        np.testing.assert_allclose(alone[name].flexion_axes, unit(ct.flexion_axes), atol=1e-12)
        expected = (ct.lengths_mm + hands[1][name].lengths_mm) / 2
        np.testing.assert_allclose(half[name].lengths_mm, expected)
        np.testing.assert_allclose(np.linalg.norm(half[name].directions, axis=-1), 1.0)
