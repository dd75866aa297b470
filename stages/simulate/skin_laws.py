"""Laws of the skin, each outside of what any estimator assumes in its own way.

Saturating, the usual one: a receiver moves with its two joints, ever less as they bend, partly late.
Polynomial: a quadratic in the flexion of both joints with their product, each seen through Bouc-Wen
hysteresis (rate-independent, unlike a lag), which grows on where the usual law saturates; coefficients have
heavy tails, as have the steps of a slow wander, and slips stay. Phase lag: all of it comes late, and through
the web and the palm a receiver is moved by joints of other digits.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from shukotsu.anatomy import drawn_hands as drawn
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.simulate.moving_skin import Skin, lagged, wander
from shukotsu.stages.simulate.random_hand import BONES, DIGITS, FLEXION, JOINTS
from shukotsu.stages.simulate.task_motion import RATE_HZ

_TAIL, _FARTHEST = 3.0, 5.0


def saturating(
    angles_rad: Array, skin: Skin, of_hand: np.random.Generator, of_recording: np.random.Generator
) -> tuple[Array, Array]:
    """Slide and turn in proportion to the saturating flexion of both joints; beside it, a slow wander."""
    loose = (skin.looseness[:, None] * skin.present)[..., None]
    slide = of_hand.standard_normal((len(skin.bone), 2, 3)) * drawn.SLIDE_SD_MM * loose
    tilt = of_hand.standard_normal((len(skin.bone), 2, 3)) * drawn.TILT_SD * loose
    tilt[skin.distal, 0, 1] += skin.scale * drawn.DISTAL_TILT
    direct = drawn.SATURATION_RAD * np.tanh(angles_rad[..., FLEXION] / drawn.SATURATION_RAD)
    start, late = direct[:1], drawn.LAG_SHARE
    drive = start + (1 - late) * (direct - start) + late * lagged(direct - start, drawn.LAG_S)
    drive = drive[:, skin.joint]  # (T, S, 2)
    off = wander(of_recording, len(drive), len(skin.bone)) * skin.looseness[:, None]
    return (
        np.einsum("tsa,sax->tsx", drive, slide) + drawn.WANDER_MM * off[0],
        np.einsum("tsa,sax->tsx", drive, tilt) + np.radians(drawn.WANDER_DEG) * off[1],
    )


def polynomial(
    angles_rad: Array, skin: Skin, of_hand: np.random.Generator, of_recording: np.random.Generator
) -> tuple[Array, Array]:
    """Slide and turn by linear, bent and crossed terms of both joints, and where nothing moves besides."""
    a, b = np.moveaxis(_hysteretic(angles_rad[..., FLEXION])[:, skin.joint] * skin.present, -1, 0)
    terms = np.stack([a, b, a * np.abs(a), b * np.abs(b), a * b], -1)  # (T, S, 5)
    n_frames, n_receivers = a.shape
    linear, bent, crossed = drawn.BENT_SHARES
    share = np.array([linear, linear, bent, bent, crossed])[:, None, None]
    sizes = heavy(of_hand, (n_receivers, 5, 2, 3)) * share * np.array([drawn.SLIDE_SD_MM, drawn.TILT_SD])
    sizes *= skin.looseness[:, None, None, None]
    sizes[skin.distal, 2, 1, 1] += drawn.DISTAL_TILT * skin.scale
    slide, turn = np.einsum("tsk,skix->itsx", terms, sizes)
    keep = float(np.exp(-1.0 / (drawn.TAILED_WANDER_S * RATE_HZ)))
    settle = int(5 * drawn.TAILED_WANDER_S * RATE_HZ)
    steps = heavy(of_recording, (2, settle + n_frames, n_receivers, 3)) * np.sqrt(1 - keep**2)
    off = lfilter([1.0], [1.0, -keep], steps, axis=1)[:, settle:] * skin.looseness[:, None]
    at = of_recording.integers(0, n_frames, (drawn.SLIPS, n_receivers))
    size = drawn.SLIP_MM * heavy(of_recording, (drawn.SLIPS, n_receivers, 3))
    after = np.arange(n_frames)[None, :, None, None] >= at[:, None, :, None]
    slips = (after * size[:, None]).sum(0) * skin.looseness[:, None]
    return slide + drawn.WANDER_MM * off[0] + slips, turn + np.radians(drawn.WANDER_DEG) * off[1]


def _hysteretic(flexion_rad: Array) -> Array:
    """Angles (T, ...) as seen through Bouc-Wen hysteresis, which is at rest in the first frame: x +
    HYSTERESIS z.

    dz = dx - (2 |dx| z + dx |z|) / (3 loop): z ends at +loop however fast a joint bends, at -loop as it
    straightens.
    """
    z = np.zeros_like(flexion_rad)
    steps = np.diff(flexion_rad, axis=0)
    for frame, step in enumerate(steps):
        before = z[frame]
        pulled = (2 * np.abs(step) * before + step * np.abs(before)) / (3 * drawn.LOOP_RAD)
        z[frame + 1] = before + step - pulled
    return np.asarray(flexion_rad + drawn.HYSTERESIS * z)


def heavy(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Numbers of sd about 1 with Student's t tails (3 degrees of freedom), none beyond 5."""
    return np.asarray(np.clip(rng.standard_t(_TAIL, shape) / np.sqrt(_TAIL), -_FARTHEST, _FARTHEST))


def phase_lag(
    angles_rad: Array, skin: Skin, of_hand: np.random.Generator, of_recording: np.random.Generator
) -> tuple[Array, Array]:
    """Slide and turn in proportion to the late flexion of own joints and neighbours'; a slow wander."""
    share = shares(skin) * skin.looseness[:, None]
    shape = (*share.shape, 3)
    slide = share[..., None] * drawn.SLIDE_SD_MM * of_hand.standard_normal(shape)
    tilt = share[..., None] * drawn.TILT_SD * of_hand.standard_normal(shape)
    receivers = np.flatnonzero(skin.distal)
    tilt[receivers, skin.joint[receivers, 0], 1] += drawn.PHASE_SHARE * skin.scale * drawn.DISTAL_TILT
    flexion = angles_rad[..., FLEXION]
    late = flexion[:1] + lagged(flexion - flexion[:1], drawn.PHASE_LAG_S)
    off = wander(of_recording, len(late), len(skin.bone)) * skin.looseness[:, None]
    return (
        np.einsum("tj,sjx->tsx", late, slide) + drawn.WANDER_MM * off[0],
        np.einsum("tj,sjx->tsx", late, tilt) + np.radians(drawn.WANDER_DEG) * off[1],
    )


def shares(skin: Skin) -> Array:
    """How much each joint moves the skin under each receiver (S, J), over what one next to it does."""
    share = np.zeros((len(skin.bone), len(JOINTS)))
    for receiver, bone in enumerate(skin.bone):
        for joint, name in enumerate(JOINTS):
            share[receiver, joint] = _of_other_digit(BONES[bone], name)
        share[receiver, skin.joint[receiver, skin.present[receiver]]] = drawn.PHASE_SHARE
    return share


def _of_other_digit(bone: str, joint: str) -> float:
    """The share of a joint that is not next to the bone."""
    of_bone, _, bone_kind = bone.partition("_")
    of_joint, _, joint_kind = joint.partition("_")
    if joint_kind not in ("mcp", "pip") and joint != "thumb_cmc":
        return 0.0
    if bone == "hand":
        return 0.0 if joint_kind == "pip" else drawn.PALM_SHARE
    if of_bone not in DIGITS or of_joint not in DIGITS:
        return 0.0
    beside = abs(DIGITS.index(of_bone) - DIGITS.index(of_joint)) == 1
    return drawn.WEB_SHARE.get(bone_kind, 0.0) if beside else 0.0
