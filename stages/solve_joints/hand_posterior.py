"""Maximum a posteriori joint centres: the likelihood of each joint's frames joined with an anatomical prior.

A joint's frames are reduced to the 6 x 6 information on its centre (p, q), the skin's own unknowns integrated
out. Centres of one hand share receivers, so their prior is one Gaussian over all of them, and one linear
solve gives every centre and the covariance of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.skeleton.rotations import Array


@dataclass(frozen=True)
class Information:
    """Log-likelihood of a joint's (p, q) = x, in mm: -1/2 x^T matrix x + x^T vector.

    matrix : (6, 6); vector : (6,); residual : (N, 3) whitened, of the joint's own best fit.
    """

    matrix: Array
    vector: Array
    residual: Array


@dataclass(frozen=True)
class HandPrior:
    """Gaussian of the centres of J joints: mean (6 J,) fixed + scale * growing, loadings (6 J, L).

    The covariance at a given scale is loadings loadings^T. scale and scale_sd : the hand's size.
    """

    fixed: Array
    growing: Array
    loadings: Array
    scale: float
    scale_sd: float

    def block(self, joint: int) -> tuple[Array, Array]:
        """Give a joint's own mean (6,) and covariance (6, 6), the size of the hand unknown."""
        rows = slice(6 * joint, 6 * joint + 6)
        loads = self.loadings[rows]
        grows = self.growing[rows]
        covariance = loads @ loads.T + self.scale_sd**2 * np.outer(grows, grows)
        return self.fixed[rows] + self.scale * grows, covariance


@dataclass(frozen=True)
class HandPosterior:
    """mean : (6 J,) centres in mm; covariance : (6 J, 6 J), the size's error included; scale : the hand's."""

    mean: Array
    covariance: Array
    scale: float


def information(
    design: Array, right: Array, weights: Array, prior_mean: Array, prior_covariance: Array
) -> Information:
    """Information on (p, q) in frames design (N, 3, 6 + K) x = right (N, 3), both whitened.

    Unknowns after the sixth have the prior mean (K,) and covariance (K, K) and are integrated out.
    """
    rows = design.swapaxes(0, 1).reshape(-1, design.shape[-1])
    reduced = right.T.reshape(-1) - rows[:, 6:] @ prior_mean
    weighted = (np.tile(weights, design.shape[1])[:, None] * rows).T
    normal = weighted @ rows
    vector = weighted @ reduced
    if len(prior_mean):
        normal[6:, 6:] += np.linalg.inv(prior_covariance)
    own = np.linalg.lstsq(normal, vector, rcond=1e-12)[0]
    across = np.linalg.solve(normal[6:, 6:], normal[6:, :6])
    return Information(
        normal[:6, :6] - normal[:6, 6:] @ across,
        vector[:6] - across.T @ vector[6:],
        (reduced - rows @ own).reshape(design.shape[1], -1).T,
    )


def hand_posterior(prior: HandPrior, information: Sequence[Information]) -> HandPosterior:
    """Join the prior with the information on every joint, in the order of the prior's joints.

    The hand's size enters linearly; it is estimated from how well the centres agree with each size, and its
    error is part of the covariance.
    """
    # x = mean + loadings z: solving for z needs no inverse of a covariance that may be singular
    loads, n_loads = prior.loadings, prior.loadings.shape[1]
    mean = prior.fixed + prior.scale * prior.growing
    stretched = np.concatenate([loads, prior.scale_sd * prior.growing[:, None]], 1)
    normal = np.eye(n_loads + 1)
    vector = np.zeros(n_loads + 1)
    for joint, own in enumerate(information):
        rows = slice(6 * joint, 6 * joint + 6)
        part = stretched[rows]
        normal += part.T @ own.matrix @ part
        vector += part.T @ (own.vector - own.matrix @ mean[rows])
    covariance = np.linalg.inv(normal)
    latent = covariance @ vector
    return HandPosterior(
        mean + stretched @ latent,
        stretched @ covariance @ stretched.T,
        float(prior.scale + prior.scale_sd * latent[-1]),
    )
