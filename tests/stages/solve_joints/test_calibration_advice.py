"""What is called enough, and what more movement does not help: loose receivers, one axis, soft limbs."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from simulated_poses import write_poses

from shukotsu.schemas.advice import ENOUGH, GAP, ON_SKIN, OPEN_AXIS, UNCERTAIN
from shukotsu.schemas.config_files import check_config
from shukotsu.schemas.layout import Layout, layout_from_config
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.solve_joints.calibration_advice import Advice, advise
from shukotsu.stages.solve_joints.solve import HandDescription, stream_recordings

HINGE = {
    "layout": "hinge",
    "description": "A lid on a base.",
    "segments": {"base": {}, "lid": {}},
    "joints": {"pivot": {"parent": "base", "child": "lid", "dof": 1, "plane": {"frame": "none"}}},
    "digits": {"lid": {"segments": ["lid"]}},
}
TIME_S = np.arange(1200) / 60


def advice_on(folder: Path, poses: Poses, layout: Layout) -> dict[str, Advice]:
    """The advice on each joint of a right hand with those poses."""
    path = folder / "poses.parquet"
    write_poses(path, poses, "right", "rom")
    fit = stream_recordings([path], layout, sample_frames=True).weigh(HandDescription("right", None))
    return {row.joint: row for row in advise(fit, layout)}


def lid(turn: Rotation, slide_mm: Array | float = 0.0) -> Poses:
    """A lid that turns so on a base at rest, its hinge sliding along x; receivers of 0.2 mm noise."""
    rng = np.random.default_rng(1)
    centre = np.array([50.0, 0, 0]) + np.multiply.outer(np.broadcast_to(slide_mm, len(TIME_S)), [1.0, 0, 0])
    place = np.stack([np.zeros((len(TIME_S), 3)), centre + turn.apply([60.0, 20, 5])], 1)
    jitter = Rotation.from_rotvec(rng.normal(scale=1e-3, size=(len(TIME_S), 3)))
    mount = Rotation.from_euler("xyz", [20, 30, 10], degrees=True)
    quaternion = np.stack([jitter.as_quat(), (jitter * turn * mount).as_quat()], 1)[..., [3, 0, 1, 2]]
    valid = np.ones((len(TIME_S), 2), bool)
    place += rng.normal(scale=0.1, size=place.shape)
    return Poses(("base", "lid"), np.arange(len(TIME_S)), TIME_S, place, quaternion, valid)


ONE_AXIS = Rotation.from_rotvec(np.outer(np.sin(TIME_S) * np.radians(45), [0, 0, 1]))
FREE = ONE_AXIS * Rotation.from_euler(
    "yx", np.stack([0.3 * np.sin(2.1 * TIME_S), 0.3 * np.cos(1.3 * TIME_S)], 1)
)


@pytest.mark.parametrize(
    ("turn", "slide_mm", "kind", "said"),
    [
        (FREE, 0.0, ENOUGH, "enough"),
        (ONE_AXIS, 0.0, OPEN_AXIS, "leaves open by 354 mm where on that axis"),
        (ONE_AXIS, 12.3, UNCERTAIN, r"known to 353.8 .*at best its receivers disagree by 8\.[4-9] mm"),
        (FREE, 12.3, UNCERTAIN, r"known to 12\.\d mm only, where 10\.0 would do"),
        (FREE, 7.5, ON_SKIN, "which is a fault where they sit on something rigid"),
        (FREE, 60.0, GAP, "more movement does not help; look at the receivers on base and lid"),
    ],
)
def test_of_a_hinge_only_a_centre_that_is_known_is_enough(
    tmp_path: Path, turn: Rotation, slide_mm: float, kind: str, said: str
) -> None:
    poses = lid(turn, slide_mm * np.sin(3 * TIME_S))
    row = advice_on(tmp_path, poses, layout_from_config(check_config(HINGE, "layout", "hinge"), "hinge"))[
        "pivot"
    ]
    assert row.kind == kind
    assert re.search(said, row.columns["advice"])
