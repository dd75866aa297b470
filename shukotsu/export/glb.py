"""GLB (glTF 2.0, binary): skeleton, a body of bones and the motion in one file, for the web, XR and Blender.

Units are metres, with +Y up. The hand is a node `right-hand` or `left-hand` with the joints below it, named
as in WebXR Hand Input unless another rig was requested, and beside it a node with its body, bound to the
joints by a skin. Nodes are in the rest pose, in which the body is bound: the root is at its position in the
first frame, with its bone frame along the world's axes. The animation rotates every joint and translates the
root and the joints that leave their position in their parent. It has one key per frame with linear
interpolation (slerp for rotations). Times are device times from the first frame.

The body is a tapered solid along every bone, a ball at every joint, and nails on a hand. Only the joints are
measured; the thickness of the solids is chosen for legibility. A nail, on the back of a digit's end, shows
which side is the back of the hand, and with it whether it is a right or a left hand.

Numbers are float32: joints up to 2 m from the transmitter are within 3e-7 m of their positions in the motion.
Arrays become accessors of one binary chunk, the rest is JSON (glTF 2.0, section 4.4).
"""

from __future__ import annotations

import itertools
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Index
from shukotsu.errors import InputError
from shukotsu.export.exported_motion import facts, local_motion, require_times, require_whole, rest_pose
from shukotsu.export.rigging import with_webxr_names
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import conjugate, matrix, rotate, unit
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.whole_files import replacing

_SIDES = 6
_RINGS = ((0.2, 1.0), (0.92, 0.55))
"""Positions along a bone (0 to 1) and the relative radii there; both ends of the bone are points."""
_RADIUS = 0.2
"""Radius of a bone relative to its length, or to the skeleton's median bone length if that is less."""
_BALL = 0.19
_NAIL = np.array([0.13, 0.03, 0.19])
_BOX = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
_SHORTEST_MM = 1.0


@dataclass(frozen=True)
class Mesh:
    """Triangles fixed to joints.

    position_mm : (V, 3) at rest, in the root's bone frame. normal : (V, 3) unit. joint : (V,) index of the
    joint that a vertex moves with. bone, nail : (F, 3) vertices of the triangles of bones and nails,
    anticlockwise as seen from outside; there may be no nails.
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
    """Return the mesh of the skeleton's body at rest (`shukotsu.export.exported_motion.rest_pose`).

    Every joint except the end of the skin has a ball; every bone longer than 1 mm has a solid from its joint
    to the next, which moves with the bone's joint; a tip of a digit of known anatomy has a nail.
    """
    rest_mm, rest_turn = rest_pose(motion)
    solids = list(_solids(motion))
    first = np.cumsum([0] + [len(solid.position_mm) for solid in solids])
    triangle = np.concatenate([solid.triangle + at for solid, at in zip(solids, first[:-1], strict=True)])
    nail = np.concatenate([np.full(len(solid.triangle), solid.nail) for solid in solids])
    return Mesh(
        np.concatenate([rest_mm[s.joint] + rotate(rest_turn[s.joint], s.position_mm) for s in solids]),
        np.concatenate([rotate(rest_turn[s.joint], s.normal) for s in solids]),
        np.concatenate([np.full(len(s.position_mm), s.joint) for s in solids]),
        triangle[~nail],
        triangle[nail],
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
            yield _Solid(joint.parent, False, *_flat(_taper(motion.rest_offset_mm[index], radius)))
        if joint.tip and np.isfinite(motion.neutral[joint.parent]).all():
            onto = np.array([0.0, 0.85 * _BALL, 0.6 * _NAIL[2]])
            yield _Solid(index, True, *_flat(usual * (_NAIL * _BOX + onto)))


def _taper(along_mm: Array, radius_mm: float) -> Array:
    """Return the corners (V, 3) of a solid from the origin to a point, thickest near the origin."""
    direction = unit(along_mm)
    # any two axes at right angles to it; the second helper is used if the first is nearly along the bone
    helper = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = unit(np.cross(helper, direction))
    up = np.cross(direction, across)
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    circle = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * up
    rings = [along_mm * share + circle * radius_mm * width for share, width in _RINGS]
    return np.concatenate([np.zeros((1, 3)), *rings, along_mm[None]])


def _flat(corners: Array) -> tuple[Array, Array, Index]:
    """Return vertices, normals and triangles of a convex solid with separate vertices for every face.

    With these, edges look sharp.
    """
    faces = _faces(corners)
    position = corners[faces]
    normal = unit(np.cross(position[:, 1] - position[:, 0], position[:, 2] - position[:, 0]))
    triangle = np.arange(3 * len(faces), dtype=np.int64).reshape(-1, 3)
    return position.reshape(-1, 3), np.repeat(normal, 3, axis=0), triangle


def _sphere() -> tuple[Array, Index]:
    """Return vertices (42, 3), which are also normals, and faces (80, 3) of an icosahedron divided once."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [
        np.roll(np.array([0.0, a, b * golden]), turn) for turn in range(3) for a in (-1, 1) for b in (-1, 1)
    ]
    points = unit(np.stack(corners))
    first, second = np.nonzero(np.triu(points @ points.T > 0.4, 1))
    points = np.concatenate([points, unit(points[first] + points[second])])
    return points, _faces(points)


def _faces(corners: Array) -> Index:
    """Return the triangles (F, 3) of a convex solid with corners (V, 3), anticlockwise from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    faces = np.sort(hull.simplices.astype(np.int64), axis=1)
    order = np.lexsort(faces.T)
    faces, outward = faces[order], hull.equations[order, :3]
    a, b, c = corners[faces].swapaxes(0, 1)
    inward = np.sum(np.cross(b - a, c - a) * outward, -1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
"""Targets of buffer views: vertex attributes and indices."""

_COMPONENTS = {"uint8": 5121, "uint16": 5123, "uint32": 5125, "float32": 5126}
LARGEST = 2**32 - 1


class Document:
    """A glTF asset under construction: its JSON, with lists that `add` extends, and parts of its buffer."""

    def __init__(self, asset: dict[str, Any]) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0", **asset}}
        self._pieces: list[npt.NDArray[Any]] = []
        self._length = 0

    def add(self, kind: str, value: dict[str, Any]) -> int:
        """Append an object to the list of its kind (nodes, meshes, ...) and return its index."""
        values = self.json.setdefault(kind, [])
        values.append(value)
        return len(values) - 1

    def array(
        self, values: npt.NDArray[Any], *, target: int = 0, bounds: bool = False, normalized: bool = False
    ) -> int:
        """Add an accessor of values and return its index.

        values : shape (N,), (N, 3), (N, 4), or (N, 4, 4) with matrices transposed (column-major); their type
        becomes that of the components. target : use of the buffer view for vertices, or 0. bounds : whether
        to add min and max.
        """
        data = np.ascontiguousarray(values)
        view = {"buffer": 0, "byteOffset": self._length, "byteLength": data.nbytes}
        accessor: dict[str, Any] = {
            "bufferView": self.add("bufferViews", view | ({"target": target} if target else {})),
            "componentType": _COMPONENTS[data.dtype.name],
            "count": len(data),
            "type": {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}[data.shape[1:]],
        }
        if normalized:
            accessor["normalized"] = True
        if bounds:
            low, high = data.min(0), data.max(0)
            accessor |= {"min": np.atleast_1d(low).tolist(), "max": np.atleast_1d(high).tolist()}
        padding = np.zeros(-data.nbytes % 4, np.uint8)
        self._pieces += [data, padding]
        self._length += data.nbytes + len(padding)
        return self.add("accessors", accessor)

    def write(self, path: Path) -> None:
        """Write the asset as one GLB file. Raises InputError if it would be larger than GLB allows."""
        self.json["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(self.json, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        whole = 12 + 8 + len(text) + 8 + self._length
        if whole > LARGEST:
            raise InputError(
                f"{path}: would have {whole} bytes, and GLB cannot have more than {LARGEST}; write fewer "
                "frames at a time with --frames"
            )
        with replacing(path) as temporary, temporary.open("wb") as stream:
            stream.write(struct.pack("<4sII", b"glTF", 2, whole))
            stream.write(struct.pack("<I4s", len(text), b"JSON") + text)
            stream.write(struct.pack("<I4s", self._length, b"BIN\0"))
            for piece in self._pieces:
                stream.write(piece.astype(piece.dtype.newbyteorder("<"), copy=False).data)


MOVES_MM = 1e-6
"""A joint that leaves its rest position in its parent by more than this has positions in the animation."""

_SCALE = 1e-3
_MATERIALS = {"bone": ((0.76, 0.56, 0.44, 1.0), 0.7), "nail": ((0.93, 0.82, 0.76, 1.0), 0.35)}
"""Colour (linear) and roughness by name."""


def write(motion: PosedRecording, path: Path) -> tuple[str, ...]:
    """Write a motion without gaps, in mm with +Y up; return sentences on what the file lacks (none).

    Raises InputError if a pose is missing, if there is no frame, or if device times are missing or do not
    increase.
    """
    require_whole(motion, path, "GLB")
    require_times(motion, (motion.time_s - motion.time_s[0]).astype(np.float32), path, "GLB")
    motion = with_webxr_names(motion)
    kind = "hand" if np.isfinite(motion.neutral).any() else motion.origin.layout
    name = f"{motion.hand}-{kind}"
    provenance = facts(motion, "m", "y")
    asset = {"generator": f"{PROGRAM} {VERSION}", "extras": {"motions": [provenance]}}
    licence = provenance["licence"]
    document = Document(asset | ({"copyright": licence} if licence else {}))
    document.json |= {"scene": 0, "scenes": [{"nodes": []}]}
    root = document.add("nodes", {"name": name})
    first = root + 1
    document.json["nodes"][root]["children"] = [first]
    for node in _joint_nodes(motion, first):
        document.add("nodes", node)
    joints = list(range(first, first + len(motion.joints)))
    rest_mm, rest_turn = rest_pose(motion)
    back = conjugate(rest_turn)
    from_world = np.tile(np.eye(4), (len(back), 1, 1))  # to each joint at rest
    from_world[:, :3, :3] = matrix(back)
    from_world[:, :3, 3] = -rotate(back, (rest_mm + motion.position_mm[0, 0]) * _SCALE)
    inverse = document.array(from_world.transpose(0, 2, 1).astype(np.float32))
    skin = document.add(
        "skins", {"name": name, "inverseBindMatrices": inverse, "skeleton": first, "joints": joints}
    )
    body = {"name": f"{name}-body"}
    mesh = document.add("meshes", body | {"primitives": _primitives(document, motion)})
    # beside the hand: parents do not move a skinned mesh, and some programs reject them
    document.json["scenes"][0]["nodes"] += [root, document.add("nodes", body | {"mesh": mesh, "skin": skin})]
    document.add("animations", _animation(document, motion, name, first))
    document.write(path)
    return ()


def _joint_nodes(motion: PosedRecording, first: int) -> list[dict[str, Any]]:
    nodes: list[dict[str, Any]] = []
    for index, joint in enumerate(motion.joints):
        offset = motion.position_mm[0, 0] if joint.parent < 0 else motion.rest_offset_mm[index]
        freedom = {"degrees_of_freedom": joint.dof} if joint.dof else {}
        axis = motion.axis[index]
        turned = {"axis": axis.round(9).tolist()} if np.isfinite(axis).all() else {}
        place = {
            "translation": (offset * _SCALE).tolist(),
            "rotation": np.roll(motion.rest[index], -1).tolist(),
        }
        nodes.append({"name": joint.name, **place, "extras": {"bone": joint.segment, **freedom, **turned}})
        if joint.parent >= 0:
            nodes[joint.parent].setdefault("children", []).append(first + index)
    return nodes


def _primitives(document: Document, motion: PosedRecording) -> list[dict[str, Any]]:
    """Return the primitives of the body at rest: bones, and nails if there are any."""
    mesh = bone_mesh(motion)
    count = len(mesh.joint)
    joint = np.zeros((count, 4), np.uint8 if len(motion.joints) <= 256 else np.uint16)
    joint[:, 0] = mesh.joint
    weight = np.zeros((count, 4), np.uint8)
    weight[:, 0] = 255
    vertices = ((mesh.position_mm + motion.position_mm[0, 0]) * _SCALE).astype(np.float32)
    attributes = {
        "POSITION": document.array(vertices, target=ARRAY_BUFFER, bounds=True),
        "NORMAL": document.array(mesh.normal.astype(np.float32), target=ARRAY_BUFFER),
        "JOINTS_0": document.array(joint, target=ARRAY_BUFFER),
        "WEIGHTS_0": document.array(weight, target=ARRAY_BUFFER, normalized=True),
    }
    kind = np.uint16 if count < 2**16 else np.uint32
    primitives = []
    for name, triangles in (("bone", mesh.bone), ("nail", mesh.nail)):
        if len(triangles):
            indices = document.array(triangles.ravel().astype(kind), target=ELEMENT_ARRAY_BUFFER)
            colour, roughness = _MATERIALS[name]
            factors = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": roughness}
            material = document.add("materials", {"name": name, "pbrMetallicRoughness": factors})
            primitives.append({"attributes": attributes, "indices": indices, "material": material})
    return primitives


def _animation(document: Document, motion: PosedRecording, name: str, first: int) -> dict[str, Any]:
    since_s = np.nan_to_num(motion.time_s - motion.time_s[0])
    times = document.array(since_s.astype(np.float32), bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []

    def add(index: int, path: str, keys: Array) -> None:
        channels.append({"sampler": len(samplers), "target": {"node": first + index, "path": path}})
        output = document.array(keys.astype(np.float32))
        samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})

    offset_mm, local = local_motion(motion)
    for index in range(len(motion.joints)):
        place_mm, turn = offset_mm[:, index], unit(local[:, index])
        if index == 0 or np.abs(place_mm - motion.rest_offset_mm[index]).max() > MOVES_MM:
            add(index, "translation", place_mm * _SCALE)
        add(index, "rotation", np.roll(turn, -1, axis=-1))
    parts = (name, motion.origin.recording.task, motion.origin.recording.trial)
    start: dict[str, Any] = {"first_frame": int(motion.frame[0])}
    if np.isfinite(motion.time_s[0]):
        start["first_device_time_s"] = float(motion.time_s[0])
    title = " ".join(part for part in parts if part)
    return {"name": title, "samplers": samplers, "channels": channels, "extras": start}
