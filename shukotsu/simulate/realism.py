"""What a simulated recording shares with a real one, and the random numbers that it is drawn from."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from shukotsu.hand.drawn_hands import BLEND


@dataclass(frozen=True)
class Realism:
    """Independent switches: each assumption of the paper can be kept or dropped alone.

    mobile_palm : metacarpals 4 and 5 (and a little 2 and 3) move at their CMC joints. hinges_only : every
    joint turns about one fixed axis; MCP, thumb and wrist have no second one. perpendicular_mcp : bones face
    as their axes are, and the MCP axis is at right angles to the vector from the wrist to the MCP joint (for
        the thumb: CMC and MCP axes at right angles to the metacarpal), so that Eq. 11 finds no twist.
    glide : scale of how far joints' centres glide as they bend.
    anatomy : whom hands are drawn around, one of `shukotsu.hand.drawn_hands.ANATOMIES`.
    mounts : scale of how far receivers are misplaced; at 0 they sit exactly: axes along the bone, no lateral
        offset, so that the sagittal plane of the receiver (y = 0) holds the centre of the bone's proximal
        joint.
    artefact : scale of the skin artefact, 1 for a typical hand.
    noise : scale of the tracker's white noise.
    field_distortion : scale of the static distortion of the magnetic field.
    faults : scale of what the tracker loses and gets wrong: poses not given, signs flipped, spikes.
    """

    mobile_palm: bool = True
    hinges_only: bool = False
    perpendicular_mcp: bool = False
    glide: float = 1.0
    anatomy: str = BLEND
    mounts: float = 1.0
    artefact: float = 1.0
    noise: float = 1.0
    field_distortion: float = 1.0
    faults: float = 0.0

    @classmethod
    def full(cls) -> Realism:
        """Everything that a real recording has."""
        return cls()

    @classmethod
    def exact(cls) -> Realism:
        """Every assumption of the paper, true to rounding."""
        return cls(False, True, True, glide=0.0, mounts=0.0, artefact=0.0, noise=0.0, field_distortion=0.0)


def generator(seed: int, purpose: str, *names: str) -> np.random.Generator:
    """Return the generator of a purpose for those names (subject, hand, task): same names, same numbers.

    One stream per purpose, so that no switch and no length shifts another's numbers.
    """
    digest = hashlib.sha256("\x1f".join((purpose, *names)).encode()).digest()
    entropy = np.frombuffer(digest, "<u4")
    return np.random.default_rng(np.random.SeedSequence([seed, *(int(number) for number in entropy)]))
