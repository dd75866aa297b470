"""The usual law of the skin: each receiver moves with its two joints, ever less as they bend, partly late."""

from __future__ import annotations

import numpy as np

from shukotsu.anatomy.drawn_hands import (
    DISTAL_TILT,
    LAG_S,
    LAG_SHARE,
    SATURATION_RAD,
    SLIDE_SD_MM,
    TILT_SD,
    WANDER_DEG,
    WANDER_MM,
)
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.simulate.moving_skin import Skin, lagged, wander
from shukotsu.stages.simulate.random_hand import FLEXION


def saturating(
    angles_rad: Array, skin: Skin, of_hand: np.random.Generator, of_recording: np.random.Generator
) -> tuple[Array, Array]:
    """Slide and turn in proportion to the saturating flexion of both joints; beside it, a slow wander."""
    loose = (skin.looseness[:, None] * skin.present)[..., None]
    slide = of_hand.standard_normal((len(skin.bone), 2, 3)) * SLIDE_SD_MM * loose
    tilt = of_hand.standard_normal((len(skin.bone), 2, 3)) * TILT_SD * loose
    tilt[skin.distal, 0, 1] += skin.scale * DISTAL_TILT
    drive = _drive(angles_rad[..., FLEXION])[:, skin.joint]  # (T, S, 2)
    off = wander(of_recording, len(drive), len(skin.bone)) * skin.looseness[:, None]
    return (
        np.einsum("tsa,sax->tsx", drive, slide) + WANDER_MM * off[0],
        np.einsum("tsa,sax->tsx", drive, tilt) + np.radians(WANDER_DEG) * off[1],
    )


def _drive(flexion_rad: Array) -> Array:
    """Return the angle that moves the skin, (T, J): flexion, saturating, partly lagging behind."""
    direct = SATURATION_RAD * np.tanh(flexion_rad / SATURATION_RAD)
    start = direct[:1]
    return np.asarray(start + (1 - LAG_SHARE) * (direct - start) + LAG_SHARE * lagged(direct - start, LAG_S))
