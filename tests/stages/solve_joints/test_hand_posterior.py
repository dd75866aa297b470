"""Data and prior joined: the closed form without a prior, the prior without data, and the hand's size."""

import numpy as np
from chains import moments_of, random_chain

from shukotsu.skeleton.rotations import Array, conjugate, matrix, multiply, rotate
from shukotsu.stages.solve_joints.closed import solve_closed
from shukotsu.stages.solve_joints.hand_posterior import HandPrior, hand_posterior, information
from shukotsu.stages.solve_joints.skin_drift import drift, stacked

NOTHING = np.zeros(0), np.zeros((0, 0))


def design_of(seed: int, n_frames: int = 400) -> tuple[Array, Array, Array]:
    """Design, right side and the closed form's (p, q) of one noisy joint."""
    chain = random_chain(seed, 2, n_frames, off_axis_rad=0.4, noise_mm=0.3, in_plane=False)
    q, t = chain.poses.quaternion, chain.poses.position_mm
    back = conjugate(q[:, 0])
    rotation = matrix(multiply(back, q[:, 1]))
    design = np.concatenate([np.broadcast_to(np.eye(3), rotation.shape), -rotation], -1)
    found = solve_closed(moments_of(chain), 0, 6)
    return design, rotate(back, t[:, 1] - t[:, 0]), np.concatenate([found.p_mm, found.q_mm])


def flat(n_joints: int) -> HandPrior:
    return HandPrior(np.zeros(6 * n_joints), np.zeros(6 * n_joints), 1e6 * np.eye(6 * n_joints), 1.0, 0.1)


def test_flat_prior_and_equal_weights_give_the_closed_form() -> None:
    """Two joints at once, weights 1, nothing known: the six-value closed form to 1e-6 mm."""
    known, expected = [], []
    for seed in (1, 2):
        design, right, centre = design_of(seed)
        known.append(information(design, right, np.ones(len(right)), *NOTHING))
        expected.append(centre)
    found = hand_posterior(flat(2), known)
    np.testing.assert_allclose(found.mean, np.concatenate(expected), atol=1e-6)


def test_the_slide_law() -> None:
    """A receiver that slides c mm per rad moves the centre by c mm, and only its prior says how unsure."""
    angle = np.linspace(-0.6, 0.6, 200)
    turn = np.stack([np.cos(angle / 2), 0 * angle, np.sin(angle / 2), 0 * angle], -1)
    rotation = matrix(turn)
    design = np.concatenate([np.broadcast_to(np.eye(3), rotation.shape), -rotation], -1)
    p, q, slide = np.array([20.0, 0.0, -7.0]), np.array([-12.0, 0.0, -7.0]), np.array([1.5, 0.0, 0.0])
    right = p - rotation @ q + angle[:, None] * slide
    prior = HandPrior(np.concatenate([p, q]), np.zeros(6), 50.0 * np.eye(6), 1.0, 0.1)
    weights = np.full(200, 0.5)  # ten independent frames of 0.3 mm
    blind = hand_posterior(prior, [information(design, right, weights, *NOTHING)])
    moved = np.linalg.norm(blind.mean[:3] - p)
    assert 1.2 < moved < 1.8
    assert np.sqrt(np.diag(blind.covariance))[[0, 2]].max() < 0.3  # and it is sure of that
    free = drift(angle[:, None, None] * np.broadcast_to(np.eye(3), rotation.shape), 1.5**2 * np.eye(3))
    columns = stacked([free])
    known = information(
        np.concatenate([design, columns.columns], -1), right, weights, columns.mean, columns.covariance
    )
    honest = hand_posterior(prior, [known])
    across = np.sqrt(np.diag(honest.covariance))[[0, 2]]
    assert across.max() > 1.0
    assert np.all(np.abs(honest.mean[[0, 2]] - p[[0, 2]]) < 2.5 * across)
