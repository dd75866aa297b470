"""Carry bones about: where each joint's turns take what lay on the table."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_hands.person import Array, Joint, Person

Motion = tuple[Array, Array]
"""Where a bone is carried: turnings (T, 3, 3) and shifts (T, 3), to be applied to places on the table."""


def carry(person: Person, angles_deg: dict[str, Array]) -> tuple[dict[str, Motion], dict[str, Array]]:
    """Return each bone's motion, the forearm lying still, and each joint's centre (T, 3)."""
    n_frames = len(next(iter(angles_deg.values())))
    bones = {"forearm": (np.broadcast_to(np.eye(3), (n_frames, 3, 3)), np.zeros((n_frames, 3)))}
    centres = {}
    for joint in person.joints:
        turning, shift, centre = _move(joint, np.deg2rad(angles_deg[joint.name]))
        outer = bones[joint.parent]
        bones[joint.child] = outer[0] @ turning, placed(outer, shift)
        centres[joint.name] = placed(outer, centre)
    return bones, centres


def placed(motion: Motion, place: Array) -> Array:
    """Return places (3,) or (T, 3) of the table where a motion takes them, (T, 3)."""
    return np.asarray((motion[0] @ place[..., None])[..., 0] + motion[1])


def _move(joint: Joint, angles: Array) -> tuple[Array, Array, Array]:
    """Return turning, shift and centre of a joint: the middle between the lines about which it turns."""
    bend = angles[:, 0]
    shift = np.column_stack([np.sin(bend), 1 - np.cos(bend)]) @ joint.glide_mm.T
    turning = np.broadcast_to(np.eye(3), (len(bend), 3, 3))
    centre = np.zeros_like(shift)
    for point, axes in joint.turns:
        here = turning @ point + shift
        turning = turning @ Rotation.from_rotvec(angles @ axes.T).as_matrix()
        shift = here - turning @ point
        centre += here / len(joint.turns)
    return turning, shift, centre


def touching(person: Person, posture: dict[str, float], finger: str) -> dict[str, float]:
    """Return the posture with the thumb's pad laid on a finger's, by the least change that does it."""
    free = [f"thumb_{name}" for name in ("cmc.bend", "cmc.sway", "mcp.bend", "ip.bend")]
    free += [f"{finger}_{name}" for name in ("mcp.bend", "mcp.sway", "pip.bend", "dip.bend")]
    start = np.array([posture.get(name, 0.0) for name in free])
    easy = np.array([4.0 if name.endswith("mcp.sway") else 8.0 for name in free])

    def misses(values: Array) -> Array:
        """Pads apart, mm; how far they are from facing each other; what the change costs, as mm."""
        whole = posture | dict(zip(free, values.T, strict=True))
        zero = np.zeros(len(values))
        angles = {
            joint.name: np.column_stack([zero + whole.get(name, 0.0) for name in joint.angles])
            for joint in person.joints
        }
        bones, _ = carry(person, angles)
        pads, ways = [], []
        for name in ("thumb_distal", f"{finger}_distal"):
            bone = person.bones[name]
            pads.append(placed(bones[name], bone.base + 0.72 * (bone.end - bone.base) - 7.0 * bone.up))
            ways.append(bones[name][0] @ bone.up)
        facing = 6 * (np.einsum("ti,ti->t", *ways) + 1)
        return np.column_stack([pads[0] - pads[1], facing, (values - start) / easy])

    now = start
    for _ in range(8):
        tried = misses(now + np.vstack([np.zeros(len(free)), np.eye(len(free))]))
        step = np.linalg.lstsq((tried[1:] - tried[0]).T, -tried[0], rcond=None)[0]
        now = now + np.clip(step, -15, 15)
    return posture | dict(zip(free, now.tolist(), strict=True))
