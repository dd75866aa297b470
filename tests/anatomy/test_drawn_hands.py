"""The drawn hands: read by the simulator alone, which reads nothing that an estimator reads."""

from itertools import pairwise

import numpy as np
import pytest
from program_files import PACKAGE, package_files

from shukotsu.anatomy.drawn_hands import CT, DrawnHand
from shukotsu.skeleton.rotations import Array, unit


def readers_of(module: str) -> set[str]:
    """Folders of two levels whose modules name the anatomy module."""
    return {
        "/".join(path.relative_to(PACKAGE).parts[:-1][:2])
        for path in package_files(suffix=".py")
        if path.stem != module and module in path.read_text("utf-8")
    }


def test_no_estimator_reads_whom_the_simulator_draws() -> None:
    assert readers_of("drawn_hands") - {"anatomy"} == {"stages/simulate"}


@pytest.mark.parametrize("module", ["average_hand", "known_digits"])
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
