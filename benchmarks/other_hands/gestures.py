"""Motion of the hand: all joint angles, in degrees from the flat hand, and the pose of the arm.

A sequence of postures is drawn, which is then interpolated linearly and smoothed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_hands.person import FINGERS, Person
from shukotsu.arrays import Array

Motion = tuple[Array, Array]
"""Motion of a bone: rotations (T, 3, 3) and shifts (T, 3), which are applied to points on the table."""

Posture = dict[str, float]
Score = list[tuple[Posture, float]]
"""Postures, with the seconds from the previous one to each."""


def _all(joint: str, deg: float) -> Posture:
    return {f"{finger}_{joint}": deg for finger in FINGERS}


class _Player:
    """A person who performs a task, with an individual range, resting posture and flat posture."""

    def __init__(self, person: Person, rng: np.random.Generator) -> None:
        self.person, self.rng, self.habits = person, rng, person.habits
        self.reach = person.habits["reach"]
        self.names = tuple(angle for joint in person.joints for angle in joint.angles)
        curl = person.habits["curl"]
        self.rest: Posture = {
            **_all("mcp.bend", 18 * curl),
            **_all("pip.bend", 24 * curl),
            **_all("dip.bend", 10 * curl),
            "thumb_mcp.bend": 8 * curl,
            "thumb_ip.bend": 10 * curl,
            "thumb_cmc.sway": person.habits["thumb_out"],
            "wrist.bend": -8 * curl,
        }
        self.flat: Posture = {name: float(rng.normal(3, 3)) for name in self.names if ".bend" in name}
        self.flat |= {name: 0.0 for name in self.names if "cmc" in name or "wrist" in name}
        self.flat["thumb_cmc.bend"] = float(rng.normal(-6, 4))
        for finger, way in zip(FINGERS, (1.0, 0.0, -1.0, -1.5), strict=True):
            self.flat[f"{finger}_mcp.sway"] = way * rng.uniform(0, 5)

    def bent(self, mcp: float, pip: float, fingers: Sequence[str] = FINGERS, dip: float = np.nan) -> Posture:
        """Return a posture with fingers bent at MCP and PIP joints; DIP joints follow unless `dip` is set."""
        share = self.habits["tip_share"]
        posture: Posture = {}
        for finger in fingers:
            more = self.rng.normal(1.0, 0.06)
            posture[f"{finger}_mcp.bend"] = mcp * more * self.reach
            posture[f"{finger}_pip.bend"] = pip * more * self.reach
            posture[f"{finger}_dip.bend"] = (share * pip if np.isnan(dip) else dip) * more * self.reach
        return posture

    def to_and_fro(self, there: Posture, back: Posture, times: int, seconds: float = 2.0) -> Score:
        """Move to one posture and back several times, with varying range and pace."""
        score: Score = []
        for _ in range(times):
            pace, amount = self.rng.uniform(0.7, 1.4), self.rng.uniform(0.9, 1.05)
            score += [({name: amount * deg for name, deg in there.items()}, seconds * pace)]
            score += [({}, self.rng.uniform(0.05, 0.4)), (back, seconds * self.rng.uniform(0.7, 1.4))]
        return score


def _calibration(player: _Player, seconds: float) -> Score:
    """Move every joint through its range, in an individual order and pace."""
    times = int(np.clip(round(seconds / 32), 1, 3))
    rng, reach = player.rng, player.reach
    straight = dict(player.flat)
    sway = dict(zip(FINGERS, (16, 4, -11, -20), strict=True))
    spread = {f"{finger}_mcp.sway": deg * reach for finger, deg in sway.items()}
    spread |= {"thumb_cmc.bend": -18 * reach, "thumb_cmc.sway": -8.0}
    closed = {f"{finger}_mcp.sway": -0.25 * deg for finger, deg in sway.items()}
    cup = player.bent(35, 30) | {"thumb_cmc.bend": 22.0, "thumb_cmc.sway": 15.0}
    cup |= {"ring_cmc.bend": 13 * reach, "little_cmc.bend": 24 * reach}
    fist = player.bent(80, 90) | {"ring_cmc.bend": 8.0, "little_cmc.bend": 14.0}
    thumb_back = {name: deg for name, deg in straight.items() if name.startswith("thumb")}
    movements = {
        "knuckles": player.to_and_fro(player.bent(78, 6), straight | _all("mcp.bend", -14.0), times),
        "hook": player.to_and_fro(player.bent(2, 92), straight, times),
        "fist": player.to_and_fro(fist, straight, times),
        "spread": player.to_and_fro(spread, straight | closed, times),
        "cup": player.to_and_fro(cup, straight, times),
        "thumb bend": player.to_and_fro({"thumb_mcp.bend": 62 * reach}, thumb_back, times)
        + player.to_and_fro({"thumb_ip.bend": 72 * reach}, {"thumb_ip.bend": -8.0}, times),
        "thumb circle": _circles(player, times),
        "opposition": _opposition(player, 1),
        "wrist": player.to_and_fro({"wrist.bend": 48 * reach}, {"wrist.bend": -45 * reach}, times)
        + player.to_and_fro({"wrist.sway": 16 * reach}, {"wrist.sway": -24 * reach}, times),
    }
    alone: Score = []
    tips: Score = []
    for finger in rng.permutation(FINGERS):
        pulled = player.bent(6, 8) | player.bent(70, 75, (finger,))
        alone += player.to_and_fro(pulled, straight, 1)
        tip = f"{finger}_dip.bend"
        tips += player.to_and_fro({tip: 58 * reach}, {tip: -4.0}, times, 1.2)
    movements |= {"alone": alone, "fingertips": tips}
    score: Score = [(straight, rng.uniform(2, 5))]
    for name in rng.permutation(list(movements)):
        score += [*movements[name], (straight if rng.random() < 0.6 else player.rest, rng.uniform(1, 2))]
        score += [({}, rng.exponential(0.8))]
    return [*score, (straight, 2.0), ({}, rng.uniform(1, 4))]


def _only(posture: Posture, digit: str) -> Posture:
    return {name: deg for name, deg in posture.items() if name.startswith(digit)}


def _circles(player: _Player, times: int) -> Score:
    score: Score = []
    for way in (1, -1):
        for step in range(12 * times + 1):
            round_it = way * step * np.pi / 6
            far = 1.0 + 0.1 * player.rng.normal()
            posture = {
                "thumb_cmc.bend": 6 + 26 * player.reach * far * np.cos(round_it),
                "thumb_cmc.sway": 4 + 26 * player.reach * far * np.sin(round_it),
                "thumb_mcp.sway": 5 * np.sin(round_it + 0.5),
            }
            score += [(posture, 0.35)]
    return score


def _opposition(player: _Player, times: int) -> Score:
    """Bring the thumb's pad to each finger's in turn."""
    score: Score = []
    before = {"cmc.bend": 14.0, "cmc.sway": 30.0, "mcp.bend": 20.0, "ip.bend": 25.0}
    for _ in range(times):
        for number, finger in enumerate(FINGERS):
            meet = player.bent(48 + 3 * number, 42 + 4 * number, (finger,))
            meet |= {f"thumb_{name}": deg for name, deg in before.items()}
            meet |= {"little_cmc.bend": 5.0 * number, "ring_cmc.bend": 2.5 * number}
            met = touching(player.person, player.rest | meet, finger)
            meet = {name: met[name] for name in meet | _only(met, "thumb")}
            back = _only(player.rest, finger) | _only(player.rest, "thumb") | {"thumb_cmc.bend": 0.0}
            pace = player.rng.uniform(0.5, 1.0)
            score += [(meet, pace), ({}, player.rng.uniform(0.2, 0.6)), (back, pace)]
    return score


def _grip(player: _Player, seconds: float) -> Score:
    """Reach for objects of several sizes, close the hand around them, hold them and let go."""
    score: Score = [(player.rest, 1.0)]
    while sum(took for _, took in score) < seconds:
        width = player.rng.uniform(0, 1)  # a pencil to a jar
        wide = player.bent(14 + 8 * width, 18, dip=8)
        wide |= {"thumb_cmc.sway": 20.0, "thumb_cmc.bend": -14 * width}
        close = player.bent(62 - 30 * width, 70 - 35 * width)
        close |= {"thumb_cmc.bend": 22 - 14 * width, "thumb_cmc.sway": 24.0}
        close |= {"thumb_mcp.bend": 30 - 18 * width, "thumb_ip.bend": 36 - 20 * width}
        close |= {"little_cmc.bend": 12.0, "ring_cmc.bend": 6.0}
        turn = {"wrist.bend": player.rng.normal(-15, 12), "wrist.sway": player.rng.normal(0, 8)}
        score += [(wide | turn, player.rng.uniform(0.6, 1.2)), (close, player.rng.uniform(0.3, 0.8))]
        score += [({}, player.rng.uniform(0.5, 2)), (player.rest, player.rng.uniform(0.5, 1))]
    return score


def _keys(player: _Player, seconds: float, *, deep: float, pace_s: float, spread: float) -> Score:
    """Strike keys with one finger after another from a bent hand."""
    home = player.bent(28, 38) | {"thumb_cmc.sway": 8.0, "thumb_mcp.bend": 10.0, "wrist.bend": -14.0}
    score: Score = [(home, 1.0)]
    while sum(took for _, took in score) < seconds:
        finger = str(player.rng.choice(["thumb", *FINGERS]))
        far = player.rng.normal(1, 0.2)
        if finger == "thumb":
            down = {"thumb_cmc.sway": 8 + deep * far, "thumb_cmc.bend": player.rng.normal(6, 2 + spread)}
        else:
            down = {f"{finger}_mcp.bend": home[f"{finger}_mcp.bend"] + deep * far}
            down |= {f"{finger}_pip.bend": home[f"{finger}_pip.bend"] + player.rng.normal(0, deep)}
            down |= {f"{finger}_mcp.sway": player.rng.normal(0, spread)}
        turn = {"wrist.sway": player.rng.normal(-4, 4), "wrist.bend": player.rng.normal(-14, 5)}
        took = pace_s * player.rng.uniform(0.6, 1.5)
        score += [(down | turn, took), (_only(home, finger), took), ({}, player.rng.exponential(pace_s / 2))]
    return score


_SCORES: dict[str, Callable[[_Player, float], Score]] = {
    "calibration": _calibration,
    "grip": _grip,
    "typing": lambda player, seconds: _keys(player, seconds, deep=16.0, pace_s=0.13, spread=3.0),
    "piano": lambda player, seconds: _keys(player, seconds, deep=22.0, pace_s=0.22, spread=7.0),
    "opposition": lambda player, seconds: _opposition(player, 1 + int(seconds // 8)),
}


def move_joints(
    person: Person, task: str, rng: np.random.Generator, time_s: Array, stiff: tuple[str, ...]
) -> dict[str, Array]:
    """Return each joint's angles, (T, D) degrees."""
    player = _Player(person, rng)
    score = _SCORES[task](player, float(time_s[-1]))
    names = list(player.names)
    knots = np.zeros((len(score), len(names)))
    now = np.array([(player.flat if task == "calibration" else player.rest).get(name, 0.0) for name in names])
    for row, (posture, _) in enumerate(score):
        for name, deg in posture.items():
            now[names.index(name)] = deg
        knots[row] = now
    took_s = np.array([took for _, took in score])
    took_s[0] = min(took_s[0], time_s[-1] / 6)  # the flat posture lasts equally long at any pace
    hurry = (time_s[-1] - took_s[0]) / took_s[1:].sum()
    at_s = np.cumsum(np.append(took_s[:1], hurry * took_s[1:]))
    track = np.column_stack([np.interp(time_s, at_s, column) for column in knots.T])
    width_s = 0.1 if task in ("typing", "piano") else float(np.clip(0.35 * hurry, 0.12, 0.5))
    track = round_corners(track, time_s, width_s)
    track += wander(rng, time_s, len(names), (0.2, 1.5)) * rng.uniform(0.3, 1.0, len(names))
    shares = dict.fromkeys(("index_cmc", "middle_cmc"), 0.3) | dict.fromkeys(stiff, 0.06)
    share = np.array([shares.get(name.split(".")[0], 1.0) for name in names])
    track = track.mean(axis=0) + share * (track - track.mean(axis=0))
    tracks = dict(zip(names, track.T, strict=True))
    return {joint.name: np.column_stack([tracks[name] for name in joint.angles]) for joint in person.joints}


def move_arm(
    task: str, stands: Rotation, rng: np.random.Generator, time_s: Array
) -> tuple[Array, Rotation, Array]:
    """Draw the motion of the arm.

    Return the palm's position (T, 3), mm, and rotation in the transmitter's frame, and the share (T,) of the
    hand's weight that rests on the table. stands : rotation from the table to the transmitter.
    """
    roams_mm, tilts_deg, every_s = {
        "calibration": (45.0, 22.0, 5.0),
        "grip": (80.0, 28.0, 2.5),
        "typing": (15.0, 4.0, 3.0),
        "piano": (60.0, 6.0, 2.0),
        "opposition": (40.0, 18.0, 4.0),
    }[task]
    middle = np.array([rng.uniform(270, 380), rng.uniform(-90, 90), rng.uniform(-70, 70)])
    knots = 2 + int(time_s[-1] // every_s) + 1
    at_s = np.cumsum(rng.uniform(0.6, 1.4, knots)) * every_s
    at_s -= at_s[0]
    places = np.clip(rng.normal(0, roams_mm, (knots, 3)), -120, 120)
    turns = np.deg2rad(rng.normal(0, tilts_deg, (knots, 3)))
    lies_s = min(rng.uniform(1, 4), time_s[-1] / 6) if task == "calibration" and rng.random() < 0.6 else 0.0
    back_s = time_s[-1] - rng.uniform(1, 3) if lies_s and rng.random() < 0.5 else np.inf
    on_table = round_corners(((time_s < lies_s) | (time_s > back_s)).astype(float), time_s, 0.9)
    path = np.column_stack([np.interp(time_s, at_s, column) for column in np.hstack([places, turns]).T])
    path = round_corners(path, time_s, 0.35 * every_s) * (1 - on_table)[:, None]
    path += wander(rng, time_s, 6, (0.3, 4)) * ([0.6] * 3 + [0.006] * 3) * (1 - 0.95 * on_table)[:, None]
    return middle + path[:, :3], stands * Rotation.from_rotvec(path[:, 3:]), on_table


def round_corners(track: Array, time_s: Array, width_s: float) -> Array:
    """Smooth tracks (T,) or (T, K) over a time."""
    half = max(1, round(width_s / (time_s[1] - time_s[0]) / 2))
    weights = np.hanning(2 * half + 3)[1:-1]
    columns = track.reshape(len(track), -1)
    wide = np.pad(columns, ((half, half), (0, 0)), mode="edge")
    smooth = [np.convolve(column, weights / weights.sum(), mode="valid") for column in wide.T]
    return np.column_stack(smooth).reshape(track.shape)


def wander(rng: np.random.Generator, time_s: Array, count: int, periods_s: tuple[float, float]) -> Array:
    """Draw slow random motion (T, count) of sd 1 that does not depend on the frame rate."""
    turns = 2 * np.pi / rng.uniform(*periods_s, (8, 1, count))
    phases = rng.uniform(0, 2 * np.pi, (8, 1, count))
    return np.asarray(np.sin(turns * time_s[:, None] + phases).sum(axis=0) / 2)


def carry(person: Person, angles_deg: dict[str, Array]) -> tuple[dict[str, Motion], dict[str, Array]]:
    """Return each bone's motion with a fixed forearm, and each joint's centre (T, 3)."""
    n_frames = len(next(iter(angles_deg.values())))
    bones = {"forearm": (np.broadcast_to(np.eye(3), (n_frames, 3, 3)), np.zeros((n_frames, 3)))}
    centres = {}
    for joint in person.joints:
        angles, outer = np.deg2rad(angles_deg[joint.name]), bones[joint.parent]
        shift = np.column_stack([np.sin(angles[:, 0]), 1 - np.cos(angles[:, 0])]) @ joint.glide_mm.T
        turning, centre = np.broadcast_to(np.eye(3), (n_frames, 3, 3)), np.zeros_like(shift)
        for point, axes in joint.turns:  # the centre is the mean of the points about which it turns
            here = turning @ point + shift
            turning = turning @ Rotation.from_rotvec(angles @ axes.T).as_matrix()
            shift = here - turning @ point
            centre += here / len(joint.turns)
        bones[joint.child] = outer[0] @ turning, move_points(outer, shift)
        centres[joint.name] = move_points(outer, centre)
    return bones, centres


def move_points(motion: Motion, point: Array) -> Array:
    """Return the positions (T, 3) to which a motion moves points (3,) or (T, 3) of the table."""
    return np.asarray((motion[0] @ point[..., None])[..., 0] + motion[1])


def touching(person: Person, posture: dict[str, float], finger: str) -> dict[str, float]:
    """Change a posture as little as possible so that the thumb's pad touches a finger's."""
    free = [f"thumb_{name}" for name in ("cmc.bend", "cmc.sway", "mcp.bend", "ip.bend")]
    free += [f"{finger}_{name}" for name in ("mcp.bend", "mcp.sway", "pip.bend", "dip.bend")]
    start = np.array([posture.get(name, 0.0) for name in free])
    easy = np.array([4.0 if name.endswith("mcp.sway") else 8.0 for name in free])

    def misses(values: Array) -> Array:
        """Return residuals: offset of the pads, mm; deviation from facing each other; weighted change."""
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
            pads.append(move_points(bones[name], bone.base + 0.72 * (bone.end - bone.base) - 7.0 * bone.up))
            ways.append(bones[name][0] @ bone.up)
        facing = 6 * (np.einsum("ti,ti->t", *ways) + 1)
        return np.column_stack([pads[0] - pads[1], facing, (values - start) / easy])

    now = start
    for _ in range(8):
        tried = misses(now + np.vstack([np.zeros(len(free)), np.eye(len(free))]))
        step = np.linalg.lstsq((tried[1:] - tried[0]).T, -tried[0], rcond=None)[0]
        now = now + np.clip(step, -15, 15)
    return posture | dict(zip(free, now.tolist(), strict=True))
