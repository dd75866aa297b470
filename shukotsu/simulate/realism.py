"""Degree of realism of a simulated recording, and its random generators."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from shukotsu.hand.drawn_hands import BLEND


@dataclass(frozen=True)
class Realism:
    """Switch and scales of realism.

    By default, everything that affects a real recording is simulated, except tracker faults.

    Attributes
    ----------
    paper_joints : bool
        Joints are as the paper assumes. The palm is rigid: metacarpals 2 to 5 do not move at their CMC
        joints. Every other joint has a single fixed axis, even MCP joints, the thumb's CMC joint and the
        wrist. Bone frames are aligned with the flexion axes, and the MCP axis is perpendicular to the vector
        from the wrist to the MCP joint (for the thumb: CMC and MCP axes perpendicular to the metacarpal), so
        that Eq. 11 gives no twist.
    glide : float
        Scale of the motion of joint centres with flexion.
    anatomy : str
        Hands around which people are drawn, one of `shukotsu.hand.drawn_hands.ANATOMIES`.
    mounts : float
        Scale of the misplacement of receivers. At 0 their axes are along the bone without lateral offset, so
        that the receiver's sagittal plane (y = 0) contains the centre of the bone's proximal joint.
    artefact : float
        Scale of skin motion; 1 for a typical hand.
    noise : float
        Scale of the tracker's white noise.
    field_distortion : float
        Scale of the static distortion of the magnetic field.
    faults : float
        Scale of the tracker's faults: lost poses, flipped signs, spikes.

    """

    paper_joints: bool = False
    glide: float = 1.0
    anatomy: str = BLEND
    mounts: float = 1.0
    artefact: float = 1.0
    noise: float = 1.0
    field_distortion: float = 1.0
    faults: float = 0.0

    @classmethod
    def exact(cls) -> Realism:
        """Return settings for which all assumptions of the paper hold up to rounding errors."""
        return cls(True, glide=0.0, mounts=0.0, artefact=0.0, noise=0.0, field_distortion=0.0)


def generator(seed: int, purpose: str, *names: str, session: str = "") -> np.random.Generator:
    """Return the random generator of a purpose for some names; equal names give equal numbers.

    Each purpose has its own stream, so that a switch or the number of frames does not change other numbers.

    Parameters
    ----------
    seed : int
        Seed of the study.
    purpose : str
        Purpose of the numbers.
    *names : str
        Subject, hand, task and the like.
    session : str
        Session; the seed does not depend on it if it is empty.

    Returns
    -------
    numpy.random.Generator
        The generator.

    """
    words = (purpose, *names, session) if session else (purpose, *names)
    digest = hashlib.sha256("\x1f".join(words).encode()).digest()
    entropy = np.frombuffer(digest, "<u4")
    return np.random.default_rng(np.random.SeedSequence([seed, *(int(number) for number in entropy)]))
