"""A body to see a skeleton by: a tapered solid along every bone, a ball at every joint, nails on a hand.

Nothing of it is measured but the joints: the solids are as thick as reads well. A nail, on the back of a
digit's end, tells the back of a hand from its palm, and so a right hand from a left one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shukotsu.skeleton.posing import Index, PosedRecording
from shukotsu.skeleton.rotations import Array, rotate, unit
from shukotsu.stages.export.motion import rest_pose

_SIDES = 6
_RINGS = ((0.2, 1.0), (0.92, 0.55))
"""Where along a bone it is how wide, of its greatest radius; both ends are points."""
_RADIUS = 0.2
"""Radius of a bone by its length, and at most by the skeleton's usual length."""
_BALL = 0.19
_NAIL = np.array([0.13, 0.03, 0.19])
_SHORTEST_MM = 1.0


@dataclass(frozen=True)
class Mesh:
    """Triangles that ride rigidly on joints.

    position_mm : (V, 3) at rest, in the root's bone frame. normal : (V, 3) unit. joint : (V,) index of the
    joint that a vertex rides on. bone, nail : (F, 3) vertices of the triangles of either, anticlockwise as
    seen from outside; there may be no nails.
    """

    position_mm: Array
    normal: Array
    joint: Index
    bone: Index
    nail: Index


@dataclass(frozen=True)
class _Solid:
    """A closed surface in the bone frame of a joint: vertices (V, 3) mm, normals (V, 3), triangles (F, 3)."""

    joint: int
    nail: bool
    position_mm: Array
    normal: Array
    triangle: Index


def bone_mesh(motion: PosedRecording) -> Mesh:
    """The skeleton's body at rest (`shukotsu.stages.export.motion.rest_pose`).

    Every joint but the end of the skin has a ball, every bone of more than 1 mm a solid from its joint to the
    next, both riding on the bone's joint; a tip of a digit of known anatomy has a nail.
    """
    rest_mm, rest_turn = rest_pose(motion)
    solids = list(_solids(motion))
    first = np.cumsum([0] + [len(solid.position_mm) for solid in solids])
    triangles = [solid.triangle + start for solid, start in zip(solids, first[:-1], strict=True)]

    def of(nail: bool) -> Index:
        chosen = [t for t, solid in zip(triangles, solids, strict=True) if solid.nail == nail]
        return np.concatenate([np.empty((0, 3), np.int64), *chosen])

    return Mesh(
        np.concatenate([rest_mm[s.joint] + rotate(rest_turn[s.joint], s.position_mm) for s in solids]),
        np.concatenate([rotate(rest_turn[s.joint], s.normal) for s in solids]),
        np.concatenate([np.full(len(s.position_mm), s.joint) for s in solids]),
        of(nail=False),
        of(nail=True),
    )


def _solids(motion: PosedRecording) -> Iterator[_Solid]:
    length = np.linalg.norm(motion.rest_offset_mm, axis=1)
    usual = float(np.median(length[length > _SHORTEST_MM]))
    ball, ball_triangle = _sphere()
    for index, joint in enumerate(motion.joints):
        if joint.tip and motion.joints[joint.parent].tip:
            continue  # skin beyond the bone
        yield _Solid(index, False, ball * _BALL * usual, ball, ball_triangle)
        if length[index] > _SHORTEST_MM:
            radius = _RADIUS * min(float(length[index]), usual)
            yield _Solid(joint.parent, False, *_flat(*_tapered(motion.rest_offset_mm[index], radius)))
        if joint.tip and np.isfinite(motion.neutral[joint.parent]).all():
            corners, faces = _box(_NAIL * usual)
            onto = np.array([0.0, 0.85 * _BALL * usual, 0.6 * _NAIL[2] * usual])
            yield _Solid(index, True, *_flat(corners + onto, faces))


def _tapered(along_mm: Array, radius_mm: float) -> tuple[Array, Index]:
    """Corners (V, 3) and faces (F, 3) of a solid from the origin to a point, thickest near the origin."""
    direction = unit(along_mm)
    # any two axes across it; the second helper stands in where the first is along the bone
    helper = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = unit(np.cross(helper, direction))
    up = np.cross(direction, across)
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    circle = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * up
    rings = [along_mm * share + circle * radius_mm * width for share, width in _RINGS]
    corners = np.concatenate([np.zeros((1, 3)), *rings, along_mm[None]])
    corner = np.arange(_SIDES)
    next_corner = (corner + 1) % _SIDES
    last = np.full(_SIDES, len(corners) - 1)
    near, far = 1 + corner, 1 + _SIDES + corner
    near_next, far_next = 1 + next_corner, 1 + _SIDES + next_corner
    faces = [
        (np.zeros(_SIDES, np.int64), near_next, near),
        (near, near_next, far_next),
        (near, far_next, far),
        (far, far_next, last),
    ]
    return corners, np.concatenate([np.stack(face, -1) for face in faces])


def _box(half_mm: Array) -> tuple[Array, Index]:
    """Corners (8, 3) and faces (12, 3) of a box about the origin."""
    signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return signs * half_mm, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int64)


def _flat(corners: Array, faces: Index) -> tuple[Array, Array, Index]:
    """The same with three vertices of its own for every face, so that edges are seen as edges."""
    position = corners[faces]
    normal = unit(np.cross(position[:, 1] - position[:, 0], position[:, 2] - position[:, 0]))
    triangle = np.arange(3 * len(faces), dtype=np.int64).reshape(-1, 3)
    return position.reshape(-1, 3), np.repeat(normal, 3, axis=0), triangle


def _sphere() -> tuple[Array, Index]:
    """Vertices (42, 3), which are also normals, and faces (80, 3) of an icosahedron divided once."""
    from scipy.spatial import ConvexHull

    golden = (1 + np.sqrt(5)) / 2
    corners = [
        np.roll(np.array([0.0, a, b * golden]), turn) for turn in range(3) for a in (-1, 1) for b in (-1, 1)
    ]
    points = unit(np.stack(corners))
    first, second = np.nonzero(np.triu(points @ points.T > 0.4, 1))
    points = np.concatenate([points, unit(points[first] + points[second])])
    faces = np.sort(ConvexHull(points).simplices.astype(np.int64), axis=1)
    faces = faces[np.lexsort(faces.T)]
    inward = np.linalg.det(points[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return points, faces
