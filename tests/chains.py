"""Random chains of receivers with known joints, made with scipy's rotations instead of ours.

A chain is a base receiver followed by segments that are connected by hinges or freer joints; receivers have
random poses on their bones. Used by the tests of the joint solve, the planes, the metacarpals and the replay.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from shukotsu.hand.rotations import Array, matrix
from shukotsu.paper.moments import JointMoments
from shukotsu.paper.part_solutions import add_block
from shukotsu.study.layout import Digit, Joint, Layout, Plane, Segment
from shukotsu.tables.poses import Poses, PosesReader


@dataclass(frozen=True)
class Chain:
    """Poses of a chain or tree, and each joint's centre (p, q in mm) and axis in the parent's and child's
    frames.

    parents : index of each joint's parent segment; the child of joint i is segment i + 1.
    """

    poses: Poses
    parents: tuple[int, ...]
    p_mm: Array
    q_mm: Array
    axis_parent: Array
    axis_child: Array

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The joints, each with its child's sagittal plane."""
        names = self.poses.segments
        plane = Plane("child", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        pairs = ((names[above], child) for above, child in zip(self.parents, names[1:], strict=True))
        return tuple(Joint(f"joint_{b}", a, b, a, 1, plane) for a, b in pairs)


def smooth(rng: np.random.Generator, n_frames: int, n_channels: int) -> Array:
    """Return smooth random motion (T, C) of about unit size."""
    time = np.linspace(0.0, 2 * np.pi, n_frames)[:, None, None]
    waves = np.arange(1, 5)
    size = rng.normal(size=(n_channels, 4)) / waves**0.5
    phase = rng.uniform(0, 2 * np.pi, (n_channels, 4))
    return np.asarray((size * np.sin(waves * time + phase)).sum(-1))


def random_chain(
    seed: int,
    n_segments: int = 4,
    n_frames: int = 200,
    *,
    range_rad: float = 0.6,
    off_axis_rad: float = 0.0,
    noise_mm: float = 0.0,
    in_plane: bool = True,
    parents: tuple[int, ...] | None = None,
) -> Chain:
    """Return a random chain of hinges or, if off_axis_rad > 0, of joints that also turn a little about other
    axes.

    in_plane : put every joint centre into its child's sagittal plane (y = 0), which its axis crosses steeply.
    parents : for a tree, the index of the parent of each segment after the first.
    """
    parents = parents or tuple(range(n_segments - 1))
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(0.8 * smooth(rng, n_frames, 3)) * Rotation.random(random_state=rng)
    origin = 300 + 100 * smooth(rng, n_frames, 3)
    rotations, origins = [turn], [origin]
    p, q, axis_parent, axis_child = [], [], [], []
    for above in parents:
        turn, origin = rotations[above], origins[above]
        axis = Rotation.from_euler("xz", rng.uniform(-0.5, 0.5, 2)).apply([0.0, 1.0, 0.0])
        mount = Rotation.random(random_state=rng)
        angle = range_rad * smooth(rng, n_frames, 1)
        other = off_axis_rad * smooth(rng, n_frames, 3)
        relative = mount * Rotation.from_rotvec(angle * axis + other)
        p.append(rng.normal(size=3) * 30)
        q.append(rng.normal(size=3) * [20, 0 if in_plane else 20, 20])
        axis_parent.append(mount.apply(axis))
        axis_child.append(axis)
        child = turn * relative
        origins.append(origin + turn.apply(p[-1]) - child.apply(q[-1]))
        rotations.append(child)
    position = np.stack(origins, 1)
    position = position + noise_mm * rng.normal(size=position.shape)
    poses = as_poses(
        tuple(f"s{i}" for i in range(n_segments)),
        position,
        np.stack([rotation.as_quat(scalar_first=True) for rotation in rotations], 1),
    )
    return Chain(poses, parents, np.array(p), np.array(q), np.array(axis_parent), np.array(axis_child))


def as_poses(segments: tuple[str, ...], position_mm: Array, quaternion: Array) -> Poses:
    """Return valid poses with frames numbered from 1 at 240 Hz."""
    frame = np.arange(1, len(position_mm) + 1)
    valid: npt.NDArray[np.bool_] = np.ones(position_mm.shape[:2], bool)
    return Poses(segments, frame, frame / 240.0, position_mm, quaternion, valid)


def chain_layout(chain: Chain) -> Layout:
    """Return the layout of a chain or tree, with a digit for every segment without children, all measured.

    A digit starts at a child of the base and is named after its last segment.
    """
    names = chain.poses.segments
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    segments = {name: Segment(name, None, True, False, x, y, z) for name in names}
    joints = {joint.name: joint for joint in chain.joints}
    digits = {}
    for leaf in set(range(1, len(names))) - set(chain.parents):
        path = [leaf]
        while chain.parents[path[0] - 1] > 0:
            path.insert(0, chain.parents[path[0] - 1])
        bones = tuple(names[index] for index in path)
        digits[bones[-1]] = Digit(bones[-1], names[0], bones, tuple(f"joint_{name}" for name in bones), False)
    return Layout("made-up", "made up", segments, joints, digits, None)


def reader_of(*recordings: Poses) -> PosesReader:
    def read(*_: str) -> Iterator[Poses]:
        return iter(recordings)

    return read


def moments_of(chain: Chain, poses: Poses | None = None, block: int = 10**6) -> JointMoments:
    """Return the moments of the chain's joints over its poses or other ones, added in blocks."""
    poses = poses or chain.poses
    moments = JointMoments(len(chain.joints))
    for start in range(0, len(poses.frame), block):
        add_block(moments, poses.take(slice(start, start + block)), chain.joints)
    return moments


def gap_rms_mm(poses: Poses, joint: int, p: Array, q: Array) -> float:
    """Compute the rms gap of Eq. 1-3 directly, from p and q in the transmitter frame in every frame."""
    world = [
        np.einsum("tij,j->ti", matrix(poses.quaternion[:, joint + k]), point)
        + poses.position_mm[:, joint + k]
        for k, point in enumerate((p, q))
    ]
    return float(np.sqrt(np.mean(np.sum((world[0] - world[1]) ** 2, -1))))
