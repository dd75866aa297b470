"""The fit's model of the room's field distortion: correcting rotations for it, and estimating it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from simulated_poses import recorded

from shukotsu.fit.chain_builder import Unknowns
from shukotsu.fit.fit import FitSettings, fit_hand
from shukotsu.fit.normal_equations import FieldDistortion
from shukotsu.hand.average_hand import PRIOR
from shukotsu.study.layout import Layout

TURN_DEG = np.array([0.9, -1.1, 0.7])


def test_undoing_the_field_restores_the_true_rotations() -> None:
    """Rotations distorted by a constant turn and a linear gradient come back as they were."""
    rng = np.random.default_rng(4)
    unknowns = Unknowns()
    unknowns.add("scale", "hand")
    place_mm = rng.uniform(-200, 200, (5, 3, 3))
    field = FieldDistortion.among(unknowns, place_mm.reshape(-1, 3))
    x = np.append(0.0, rng.normal(size=12))
    turn = x[1:4] * PRIOR.FIELD_TURN_SD_RAD
    slope = x[4:].reshape(3, 3) * PRIOR.FIELD_SLOPE_SD_RAD_PER_MM
    turned = Rotation.from_rotvec((turn + (place_mm - field.centre_mm) @ slope.T).reshape(-1, 3))
    true = Rotation.random(15, random_state=1)
    measured = (turned * true).as_matrix().reshape(5, 3, 3, 3)
    undone = field.turn(place_mm, -x) @ measured
    assert undone == pytest.approx(true.as_matrix().reshape(5, 3, 3, 3))
    assert field.turn(place_mm, x) == pytest.approx(turned.as_matrix().reshape(5, 3, 3, 3))


def test_the_field_is_constant_beyond_the_measured_region() -> None:
    field = FieldDistortion.among(Unknowns(), np.array([[100.0, 0.0, 0.0], [-100.0, 0.0, 0.0]]))
    within, edge, beyond = field.by_unknown(np.array([[50.0, 0, 0], [100.0, 0, 0], [900.0, 0, 0]]))
    np.testing.assert_allclose(beyond, edge)
    np.testing.assert_allclose(2 * within[:, 3:], edge[:, 3:])
    np.testing.assert_allclose(within[:, :3], PRIOR.FIELD_TURN_SD_RAD * np.eye(3))


@pytest.mark.slow
def test_a_constant_field_turn_is_estimated_when_the_hand_turns(layout: Layout) -> None:
    """A turn common to all receivers and fixed in the room is estimated to 0.35 deg, and about 0 without
    one.
    """
    poses = recorded(seed=12, n_frames=1500, artefact=0.0, field_distortion=0.0, glide=0.0)[1]
    rng, frames = np.random.default_rng(2), len(poses.frame)
    time = np.linspace(0, 2 * np.pi, frames)
    arm = Rotation.from_rotvec(np.stack([np.sin(time), np.cos(2 * time), np.sin(3 * time)], 1) * 0.7)
    everywhere = Rotation.from_matrix(np.repeat(arm.as_matrix(), len(poses.segments), axis=0))
    middle_mm = poses.position_mm.mean(1, keepdims=True)
    moved_mm = everywhere.apply((poses.position_mm - middle_mm).reshape(-1, 3)).reshape(frames, -1, 3)
    riding = everywhere * Rotation.from_quat(poses.quaternion.reshape(-1, 4), scalar_first=True)
    field = Rotation.from_rotvec(np.radians(TURN_DEG))
    turn_deg = {}
    for name, turn in (("none", Rotation.identity()), ("turned", field)):
        quaternion = (turn * riding).as_quat(scalar_first=True).reshape(poses.quaternion.shape)
        noise_mm = rng.normal(0, 0.05, moved_mm.shape)
        held = replace(poses, position_mm=moved_mm + middle_mm + noise_mm, quaternion=quaternion)
        fit = fit_hand([held], layout, "right", settings=FitSettings(n_frames=60))
        of_field = np.array(fit.model.unknowns.groups) == "field turn"
        turn_deg[name] = np.degrees(fit.posterior.x[of_field] * PRIOR.FIELD_TURN_SD_RAD)
    assert np.abs(turn_deg["none"]).max() < 0.25
    assert turn_deg["turned"] - turn_deg["none"] == pytest.approx(TURN_DEG, abs=0.35)
