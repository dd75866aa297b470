"""Thumb metacarpal receivers on the nail's side give the same thumb as ones on the back of the hand."""

from functools import cache

import numpy as np
import pytest
from simulated_poses import recorded

from benchmarks.faultless_hands import facing_the_nail, nail_turn
from shukotsu.fit.fit import FitSettings, HandFit, fit_hand
from shukotsu.fit.fitted_motion import joint_angles_of, pose_hand
from shukotsu.hand.rotations import Array, rotate
from shukotsu.simulate.simulation import Simulated
from shukotsu.study.layout import read_layout

pytestmark = pytest.mark.slow

LAYOUT = read_layout("liberty16")
QUICK = FitSettings(n_frames=40, rounds=1)
SEEDS = (4, 5, 7)
HANDS = pytest.mark.parametrize("seed", SEEDS)
SIDES = pytest.mark.parametrize("side", ["right", "left"])


@cache
def fitted(seed: int, side: str, *, nail: bool) -> tuple[Simulated, HandFit]:
    drawn = recorded(side, seed=seed)[0]
    drawn = facing_the_nail(drawn) if nail else drawn
    return drawn, fit_hand([drawn], LAYOUT, side, settings=QUICK)


def errors_mm(seed: int, side: str, *, nail: bool) -> Array:
    """Return the errors (2, 2, 3) in mm: CMC and MCP, in the parent's and the child's frame, x y z."""
    drawn, fit = fitted(seed, side, nail=nail)
    both = [(fit.joints[name], drawn.truth.joints[name]) for name in ("thumb_cmc", "thumb_mcp")]
    errors = np.array([(at.parent_mm - true.parent_mm, at.child_mm - true.child_mm) for at, true in both])
    if nail:  # as the receiver on the back of the hand sees them
        errors[[0, 1], [1, 0]] = rotate(nail_turn(drawn), errors[[0, 1], [1, 0]])
    return errors


@HANDS
@SIDES
def test_both_facings_give_the_same_thumb(seed: int, side: str) -> None:
    """The fit recognises the facing; no centre is doubtful, and the two fits differ by less than their
    sds.
    """
    back, front = (errors_mm(seed, side, nail=nail) for nail in (False, True))
    fits = [fitted(seed, side, nail=nail)[1] for nail in (False, True)]
    assert [fit.model.anatomy["thumb"].faces_nail for fit in fits] == [False, True]
    for row, name in enumerate(("thumb_cmc", "thumb_mcp")):
        sd_mm = [fit.joints[name].sd_mm for fit in fits]
        assert sd_mm[1] < 1.15 * sd_mm[0]
        assert not fits[1].joints[name].doubts
        assert np.linalg.norm(back[row] - front[row], axis=-1).max() < np.hypot(*sd_mm)


@SIDES
def test_thumb_angles_do_not_depend_on_how_the_receiver_faces(side: str) -> None:
    """The same motion is recorded with the receiver on the back of the hand and on the nail's side."""
    angles_deg = []
    for nail in (False, True):
        drawn, fit = fitted(4, side, nail=nail)
        poses = drawn.take(np.arange(0, len(drawn.frame), 24))
        of_joint = joint_angles_of(fit, pose_hand(fit, poses))
        angles_deg.append([of_joint["thumb_cmc"], of_joint["thumb_mcp"]])
    assert (np.abs(np.subtract(*angles_deg)).mean((0, 1)) < 8.0).all()
    assert np.ptp(angles_deg[0][0][:, 0]) > 15.0
