"""Motion during a task: joint angles over time from a script of postures, and the sway of the arm.

A posture is an array (J, 2) of voluntary flexion and abduction in degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Array
from shukotsu.hand import rotations
from shukotsu.simulate import random_hand
from shukotsu.simulate.forward import coupled_angles, poses_in_hand
from shukotsu.simulate.random_hand import ABDUCTION, FINGERS, FLEXION, JOINTS, TIP_BONES, RandomHand
from shukotsu.simulate.realism import Realism, generator
from shukotsu.tables.poses import RecordingName

RATE_HZ = 240.0
TASK_FRAMES = {"opposition": 3774, "rom": 7200}
"""Tasks and their default numbers of frames; 3774 is the length of the paper's recording."""

_ROUND_S = 4.0
_JITTER_DEG, _CMC_JITTER_DEG, _DIP_JITTER_DEG = 1.5, 0.4, 0.1
_CUP_DEG = {"index": 2.0, "middle": 1.2, "ring": 10.0, "little": 16.0}  # CMC flexion of a cupped palm
# share of the cupping when the thumb meets the finger
_CUPPING = {"index": 0.1, "middle": 0.35, "ring": 0.7, "little": 1.0}
# share of a finger's movement that other fingers follow (enslaving): itself, then 1, 2 and 3 fingers away
_ENSLAVING = (1.0, 0.35, 0.15, 0.08)


# Settings for postures in which the pads of thumb and finger meet, found by inverse kinematics.
_DISTANCE_SD_MM, _FACING_SD = 0.4, 0.8
_STEPS, _NUDGE_DEG, _LARGEST_STEP_DEG = 25, 0.05, 12.0

# joint and angle; usual value, spread, minimum and maximum, deg; the last three are of the finger
_ANGLES = (
    ("thumb_cmc", FLEXION, 26.0, 13.0, -10.0, 52.0),
    ("thumb_cmc", ABDUCTION, -12.0, 10.0, -35.0, 25.0),
    ("thumb_mcp", FLEXION, 25.0, 13.0, 18.0, 60.0),
    ("thumb_ip", FLEXION, 25.0, 13.0, 18.0, 65.0),
    ("mcp", FLEXION, 45.0, 8.0, 29.0, 72.0),
    ("mcp", ABDUCTION, 0.0, 4.0, -15.0, 15.0),
    ("pip", FLEXION, 46.0, 6.0, 32.0, 62.0),
)


@dataclass(frozen=True)
class TaskMotion:
    """Motion of hand and arm over T frames.

    Attributes
    ----------
    angles_rad : array, shape (T, J, 3)
        Flexion, abduction and axial rotation.
    wrist_mm : array, shape (T, 3)
        Wrist centre in the transmitter frame.
    forearm : array, shape (T, 4)
        Unit quaternions (w, x, y, z), forearm to transmitter frame.

    """

    angles_rad: Array
    wrist_mm: Array
    forearm: Array


def move(name: RecordingName, seed: int, hand: RandomHand, realism: Realism, n_frames: int) -> TaskMotion:
    """Simulate the motion of a hand during a task.

    Parameters
    ----------
    name : RecordingName
        The recording.
    seed : int
        Seed of the simulation.
    hand : RandomHand
        The hand.
    realism : Realism
        Which motions are locked.
    n_frames : int
        Number of frames T, which determines how fast the movements are.

    Returns
    -------
    TaskMotion
        Motion over T frames.

    """
    subject, task = name.subject, name.task
    rng = generator(seed, "motion", subject, hand.side, task, session=name.session)
    if task == "opposition":
        stiffness = generator(seed, "dip", subject, hand.side)
        script, weights = _opposition(rng, stiffness, hand, realism, n_frames)
    else:
        script, weights = _range_of_motion(generator(seed, "range", subject, hand.side))
    script = script + _jitter_deg(rng, script, task)
    durations = weights * np.clip(1.0 + 0.15 * rng.standard_normal(len(weights)), 0.6, 1.4)
    ends = np.concatenate([[0.0], np.cumsum(durations)])
    times_s, at_s = ends / ends[-1] * (n_frames - 1) / RATE_HZ, np.arange(n_frames) / RATE_HZ
    i = np.clip(np.searchsorted(times_s, at_s, side="right") - 1, 0, len(times_s) - 2)
    u = np.clip((at_s - times_s[i]) / (times_s[i + 1] - times_s[i]), 0.0, 1.0)
    share = (u**3 * (10 - 15 * u + 6 * u**2))[:, None, None]  # minimum jerk (Flash & Hogan 1985)
    postures = script[i] + share * (script[i + 1] - script[i])
    voluntary = np.concatenate([np.radians(postures), np.zeros((*postures.shape[:2], 1))], -1)
    wrist, forearm = _arm(rng, n_frames)
    return TaskMotion(coupled_angles(voluntary, hand, realism), wrist, forearm)


def posture(**angles_deg: float | tuple[float, float]) -> Array:
    """Build a posture (J, 2), deg, from flexion, or flexion and abduction, by joint name."""
    posture = np.zeros((len(JOINTS), 2))
    for joint, value in angles_deg.items():
        posture[JOINTS.index(joint)] = value if isinstance(value, tuple) else (value, 0.0)
    return posture


def _fingers(joint: str, flexion_deg: float) -> Array:
    """Return a posture with the same flexion of one joint in all fingers."""
    return posture(**{f"{digit}_{joint}": flexion_deg for digit in FINGERS})


def rest_posture() -> Array:
    """Return the posture of the open hand, in which every movement starts."""
    fingers = sum(_fingers(joint, flexion_deg) for joint, flexion_deg in random_hand.OPEN_DEG.items())
    return np.asarray(fingers + posture(thumb_cmc=(2.0, 4.0), thumb_mcp=6.0, thumb_ip=6.0))


def _cup_posture() -> Array:
    """Return the posture of the cupped palm."""
    return posture(**{f"{digit}_cmc": angle for digit, angle in _CUP_DEG.items()})


def _opposition(
    rng: np.random.Generator, of_hand: np.random.Generator, hand: RandomHand, realism: Realism, n_frames: int
) -> tuple[Array, Array]:
    """Write the script in which the thumb's pad meets each finger's pad in turn.

    rng, of_hand : generators of the recording, and of the stiffness of the DIP joints. Return keyframes
    (K, J, 2), deg, and relative durations (K - 1,).
    """
    rest = rest_posture()
    starts = np.repeat(rest[None], len(FINGERS), 0)
    for i, digit in enumerate(FINGERS):
        starts[i, :, FLEXION] += _CUPPING[digit] * _cup_posture()[:, FLEXION]
    dips = [JOINTS.index(f"{digit}_dip") for digit in FINGERS]
    ranges_deg, stiff_deg = (of_hand.uniform(*limits, len(FINGERS)) for limits in ((4.0, 10.0), (2.0, 3.0)))
    if hand.side == "left":
        ranges_deg[2:] = stiff_deg[2:]  # the DIP joints of ring and little finger hardly move
    starts[:, dips, FLEXION] += np.diag(ranges_deg)
    contacts = contact_postures(hand, starts, realism)
    apart = contacts - rest
    for i, finger in enumerate(FINGERS):  # the other fingers follow the one that meets the thumb
        for k, other in enumerate(FINGERS):
            if other != finger:
                joints = [JOINTS.index(f"{other}_{kind}") for kind in ("mcp", "pip", "dip")]
                contacts[i, joints] = rest[joints] + _ENSLAVING[abs(i - k)] * apart[k, joints]
    n_rounds = max(1, round(n_frames / RATE_HZ / _ROUND_S))
    keyframes, weights = [rest], []
    for _ in range(n_rounds):
        for i in range(len(FINGERS)):
            bend = posture(wrist=(rng.uniform(2, 8) * (-1) ** i, rng.uniform(-3, 3)))
            keyframes += [contacts[i] + bend, contacts[i] + bend, rest - bend]
            weights += [0.42, 0.14, 0.42]
    return np.array(keyframes), np.array(weights)


def _range_of_motion(rng: np.random.Generator) -> tuple[Array, Array]:
    """Write the script that moves joints through their ranges, singly and together; see `_opposition`."""
    hook = _fingers("pip", 72.0) + _fingers("dip", 50.0)
    fist = _fingers("mcp", 54.0) + _fingers("pip", 70.0) + _fingers("dip", 58.0)
    spread = posture(index_mcp=(0, 14), middle_mcp=(0, 4), ring_mcp=(0, -8), little_mcp=(0, -15))
    alone = [
        posture(**{f"{digit}_mcp": 50.0, f"{digit}_pip": 66.0, f"{digit}_dip": 52.0}) for digit in FINGERS
    ]
    circle = [
        posture(thumb_cmc=(22 * np.cos(angle) + 8, 16 * np.sin(angle)), thumb_mcp=8 - 8 * np.cos(angle))
        for angle in np.linspace(0, 2 * np.pi, 6, endpoint=False)
    ]
    bent = [posture(thumb_mcp=(48.0, 6.0)), posture(thumb_ip=60.0), posture(thumb_mcp=(20.0, -8.0))]
    across = posture(thumb_cmc=(25.0, -8.0), thumb_mcp=35.0, thumb_ip=45.0)
    grasp = _fingers("mcp", 40.0) + _fingers("pip", 45.0) + _fingers("dip", 32.0) + _cup_posture()
    grasp = grasp + posture(thumb_cmc=(28.0, -10.0), thumb_mcp=25.0, thumb_ip=25.0)
    wrist = [posture(wrist=bend) for bend in ((35.0, 0.0), (-35.0, 0.0), (0.0, 14.0), (0.0, -18.0))]
    fingers = [_fingers("mcp", 54.0), hook, fist, spread, -spread, _fingers("mcp", -25.0), *alone]
    turned = grasp + posture(wrist=(-20.0, 5.0))
    poses = [*fingers, *circle, *bent, across, _cup_posture(), grasp, *wrist, turned]
    rest = rest_posture()
    keyframes = [rest]
    for pose in poses:
        keyframes += [rest + pose, rest]
    factor = np.clip(1.0 + 0.07 * rng.standard_normal((len(JOINTS), 1)), 0.85, 1.12)
    script = rest + (np.array(keyframes) - rest) * factor
    return script, rng.uniform(0.85, 1.15, len(script) - 1)


def _jitter_deg(rng: np.random.Generator, script: Array, task: str) -> Array:
    """Draw the variation between repetitions of a posture, (K, J, 2); small for DIP joints in opposition."""
    sd = np.full((len(JOINTS), 2), _JITTER_DEG)
    sd[:, ABDUCTION] /= 2
    sd[random_hand.FINGER_CMC] = _CMC_JITTER_DEG
    if task == "opposition":
        sd[[j for j, joint in enumerate(JOINTS) if joint.endswith("_dip")]] = _DIP_JITTER_DEG
    jitter = sd * np.clip(rng.standard_normal(script.shape), -2.5, 2.5)
    held = (np.abs(np.diff(script, axis=0)).max((1, 2)) == 0).nonzero()[0] + 1
    jitter[held] = jitter[held - 1]
    return np.asarray(jitter)


def _arm(rng: np.random.Generator, n_frames: int) -> tuple[Array, Array]:
    """Return wrist centre (T, 3), mm, and forearm (T, 4), swaying by cm and degrees, back of the hand up."""
    away, around, roll = np.radians(rng.uniform([106.0, -20.0, -15.0], [118.0, 20.0, 15.0]))
    distal = np.array([np.cos(away), np.sin(away) * np.cos(around), np.sin(away) * np.sin(around)])
    lateral = rotations.unit(np.cross([0.0, 0.0, 1.0], distal))
    base = rotations.from_matrix(np.stack([distal, lateral, np.cross(distal, lateral)], -1))
    base = rotations.multiply(base, rotations.about_axis(np.array([1.0, 0.0, 0.0]), roll))
    place_mm = np.array([260.0, 40.0, -120.0]) + rng.uniform(-30.0, 30.0, 3)
    time_s = np.arange(n_frames)[:, None, None] / RATE_HZ
    rate_hz = rng.uniform([0.08, 0.15, 0.3], [0.15, 0.3, 0.5], (6, 3))  # three sinusoids per signal
    phase = rng.uniform(0, 2 * np.pi, (6, 3))
    waves = np.sin(2 * np.pi * rate_hz * time_s + phase) * np.array([1.0, 0.6, 0.3])
    sway = waves.sum(-1) / np.sqrt((1.0 + 0.36 + 0.09) / 2)  # of sd 1
    turn = np.radians(4.0) * sway[:, 3:]
    turned = rotations.about_axis(rotations.unit(turn), np.linalg.norm(turn, axis=-1))
    return place_mm + 14.0 * sway[:, :3], rotations.multiply(base, turned)


def contact_postures(hand: RandomHand, starts_deg: Array, realism: Realism) -> Array:
    """Find postures in which the pads of thumb and finger meet as well as possible, by Gauss-Newton.

    Parameters
    ----------
    hand : RandomHand
        The hand.
    starts_deg : array, shape (4, J, 2)
        Starting posture for each finger.
    realism : Realism
        Which motions are locked.

    Returns
    -------
    array, shape (4, J, 2)
        Voluntary flexion and abduction, deg.

    """
    named = [[name if name in JOINTS else f"{digit}_{name}" for name, *_ in _ANGLES] for digit in FINGERS]
    joints = np.array([[JOINTS.index(name) for name in names] for names in named])
    columns = np.array([column for _, column, *_ in _ANGLES])
    usual, spread, least, most = np.array([angle[2:] for angle in _ANGLES]).T
    angles = np.tile(usual, (len(FINGERS), 1))
    n = len(usual)
    nudges = np.vstack([np.zeros(n), _NUDGE_DEG * np.eye(n)])
    rows = np.arange(len(FINGERS))[:, None]
    for _ in range(_STEPS):
        postures = np.repeat(starts_deg[:, None], n + 1, 1)  # finger, nudged angle
        postures[rows[..., None], np.arange(n + 1)[:, None], joints[:, None], columns] = (
            angles[:, None] + nudges
        )
        misfit = _misfit(hand, postures, realism)
        jacobian = np.swapaxes(misfit[:, 1:] - misfit[:, :1], 1, 2) / _NUDGE_DEG
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian + np.diag(1.0 / spread**2)
        slope = np.einsum("fra,fr->fa", jacobian, misfit[:, 0]) + (angles - usual) / spread**2
        step = -np.linalg.solve(normal, slope[..., None])[..., 0]
        angles = np.clip(angles + np.clip(step, -_LARGEST_STEP_DEG, _LARGEST_STEP_DEG), least, most)
    met = starts_deg.copy()
    met[rows, joints, columns] = angles
    return met


def _misfit(hand: RandomHand, postures_deg: Array, realism: Realism) -> Array:
    """Return residuals (4, N, 6), zero at contact: offset of the pads and sum of normals, over tolerances."""
    fingers, n = postures_deg.shape[:2]
    voluntary = np.radians(postures_deg.reshape(fingers * n, len(JOINTS), 2))
    padded = np.concatenate([voluntary, np.zeros((*voluntary.shape[:2], 1))], -1)
    position, quaternion = poses_in_hand(hand, coupled_angles(padded, hand, realism))
    pads = position[:, TIP_BONES] + rotations.rotate(quaternion[:, TIP_BONES], hand.pad_mm)
    normals = rotations.rotate(quaternion[:, TIP_BONES], np.array([0.0, 0.0, -1.0]))
    finger = 1 + np.repeat(np.arange(fingers), n)
    frames = np.arange(fingers * n)
    apart = (pads[:, 0] - pads[frames, finger]) / _DISTANCE_SD_MM
    facing = (normals[:, 0] + normals[frames, finger]) / _FACING_SD
    return np.concatenate([apart, facing], -1).reshape(fingers, n, 6)
