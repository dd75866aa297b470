"""OpenUSD as text (`.usda`): skeleton, a body of bones and the motion, for film, Omniverse and Blender.

Written here and not by OpenUSD's own library, so that an export needs nothing more to be installed, is the
same file every time, and can be read by eye. Every USD program reads text; a binary crate of the same holds a
third of the bytes and is one command away (docs/usd.md).

`/World` is the default prim. In it a hand is a SkelRoot `right_hand` or `left_hand`: a Skeleton, below that
its SkelAnimation, and beside it meshes that ride rigidly on the joints, `right_hand_bones` and, where there
are any, `right_hand_nails`. Joints are named as in WebXR Hand Input where no other rig was asked for, with
`_` for what no USD identifier may have. At rest, which is also the pose that the meshes are bound in, the
root is where the first frame has it, fingers straight and level, back up.

A sample a frame, at the device time counted from the first frame, in time codes: whole ones where the times
are even. Between them USD blends positions linearly and rotations by slerp. Values are told to 1e-8 m, and
programs hold them as float32: joints up to 2 m from the transmitter are within 3e-7 m of where the motion has
them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.files.long_arrays import BLOCK_FRAMES
from shukotsu.files.whole_files import replacing
from shukotsu.schemas import PROGRAM, VERSION
from shukotsu.skeleton.rotations import Array, matrix, multiply, rotate
from shukotsu.stages.export.axes import UNITS_PER_MM, Target, upright
from shukotsu.stages.export.bone_mesh import bone_mesh
from shukotsu.stages.export.file_facts import facts, joint_facts
from shukotsu.stages.export.motion import (
    SkeletonMotion,
    Whole,
    local_motion,
    require_times,
    require_whole,
    rest_pose,
)
from shukotsu.stages.export.resampling import largest_time_error_s
from shukotsu.stages.export.rig_names import plain_names
from shukotsu.stages.export.rigging import with_webxr_names

LENGTH_DECIMALS = {"m": 8, "cm": 6, "mm": 5}
TURN_DECIMALS = 8
CODE_DECIMALS = 6
"""Of time codes: at 240 Hz some nanoseconds."""

ALONE_HZ = 24.0
"""Time codes a second of a file of one frame, whose rate nobody knows: what USD takes where none is said."""

_COLOURS = {"bone": ((0.76, 0.56, 0.44), 0.7), "nail": ((0.93, 0.82, 0.76), 0.35)}
"""Colour (linear) and roughness by material."""

_AS_IT_IS = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"
_NOTABLE_S = 5e-4
_INDENT = "    "


@dataclass(frozen=True)
class _Hand:
    """A motion with the names that are written.

    name : of its SkelRoot. joints : paths of the joints in the skeleton. codes : (T,) time codes.
    scale : the file's units per mm. decimals : of a length.
    rest_mm, rest_turn : (J, 3), (J, 4) bone frames at rest in the world of the file.
    """

    motion: SkeletonMotion
    name: str
    joints: tuple[str, ...]
    codes: Array
    scale: float
    decimals: int
    rest_mm: Array
    rest_turn: Array

    @property
    def skeleton(self) -> str:
        """Name of its Skeleton; programs that know no paths want one that no other hand has."""
        return f"{self.name}_skeleton"


@dataclass(frozen=True)
class _Part:
    """The vertices (V, ...) of a hand's body that are of one material, and their triangles (F, 3)."""

    kind: str
    position_mm: Array
    normal: Array
    joint: Whole
    triangle: Whole


def write(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    """Write one motion, which has no gap and whose world has target.up upward; give what the file lacks.

    Raises InputError where a pose is missing, there is no frame, or device time is missing or does not grow.
    """
    return write_scene([motion], target, path)


def write_scene(motions: Sequence[SkeletonMotion], target: Target, path: Path) -> tuple[str, ...]:
    """Write several motions, such as both hands of a person, each a SkelRoot of its own.

    Each begins at time code 0: times of recordings that were made one after the other do not tell what was
    when in the other. Time codes are those of the first motion's rate. Raises InputError as `write`.
    """
    known = [motion.rate_hz for motion in motions if np.isfinite(motion.rate_hz)]
    rate_hz = round(known[0], 9) if known else ALONE_HZ
    names = _identifiers([f"{motion.origin.hand}_{motion.kind}" for motion in motions])
    hands = [
        _hand(motion, name, _codes(motion, rate_hz, path), target)
        for motion, name in zip(motions, names, strict=True)
    ]
    remarks = _remarks(motions)
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(f"{line}\n" for line in _layer(hands, target, rate_hz, remarks))
    return remarks


def _codes(motion: SkeletonMotion, rate_hz: float, path: Path) -> Array:
    """Time codes (T,) from 0; InputError where the motion has a gap, or times that a file cannot hold."""
    require_whole(motion, path, "USD")
    if len(motion.frame) == 1:
        return np.zeros(1)
    codes = np.asarray(np.round((motion.time_s - motion.time_s[0]) * rate_hz, CODE_DECIMALS))
    require_times(motion, codes, path, "USD")
    return codes


def _hand(motion: SkeletonMotion, name: str, codes: Array, target: Target) -> _Hand:
    """The motion as it is written; a hand that has the layout's names gets those of WebXR."""
    motion = with_webxr_names(motion)
    joints: list[str] = []
    for joint, identifier in zip(motion.joints, _identifiers(motion.names), strict=True):
        joints.append(identifier if joint.parent < 0 else f"{joints[joint.parent]}/{identifier}")
    stand = upright("y", target.up)  # bone frames have +Y out of the back
    rest_mm, rest_turn = rest_pose(motion)
    return _Hand(
        motion,
        name,
        tuple(joints),
        codes,
        UNITS_PER_MM[target.unit],
        LENGTH_DECIMALS[target.unit],
        motion.position_mm[0, 0] + rotate(stand, rest_mm),
        multiply(stand, rest_turn),
    )


def _identifiers(names: Iterable[str]) -> list[str]:
    """Names as USD identifiers, in ASCII for programs before USD 24.03, no two the same."""
    return plain_names(name if name[:1].isalpha() else f"_{name}" for name in names)


def _layer(hands: Sequence[_Hand], target: Target, rate_hz: float, remarks: Sequence[str]) -> Iterator[str]:
    """All lines of the file."""
    known = {hand.name: _known(hand, target, remarks) for hand in hands}
    rate = f"{rate_hz:.12g}"
    metadata = [
        *_within(_entries(known), "customLayerData = {", "}"),
        'defaultPrim = "World"',
        f"doc = {_quoted(f'Hand skeletons and their motion, written by {PROGRAM} {VERSION}')}",
        f"endTimeCode = {_code(max(hand.codes[-1] for hand in hands))}",
        f"framesPerSecond = {rate}",
        f"metersPerUnit = {1e-3 / UNITS_PER_MM[target.unit]:g}",
        "startTimeCode = 0",
        f"timeCodesPerSecond = {rate}",
        f'upAxis = "{target.up.upper()}"',
    ]
    bodies = [_body(hand) for hand in hands]
    used = dict.fromkeys(part.kind for parts in bodies for part in parts)
    prims = [_prim('Scope "materials"', [], chain.from_iterable(map(_material, used)))]
    prims += [_skel_root(hand, parts) for hand, parts in zip(hands, bodies, strict=True)]
    yield "#usda 1.0"
    yield from _within(metadata, "(", ")")
    yield from _prim('Xform "World"', [], chain.from_iterable(prims))


def _known(hand: _Hand, target: Target, remarks: Sequence[str]) -> dict[str, Any]:
    """Collect the facts about a hand in the file."""
    motion = hand.motion
    known = facts(motion, target, remarks)
    known["inputs_sha256"] = [f"{digest}  {name}" for name, digest in known["inputs_sha256"].items()]
    known["first_frame"] = int(motion.frame[0])
    if np.isfinite(motion.time_s[0]):
        known["first_device_time_s"] = float(motion.time_s[0])
    return known


def _skel_root(hand: _Hand, parts: Sequence[_Part]) -> Iterator[str]:
    extent = _samples("float3[] extent", hand.codes, _extent(hand, parts), 3, hand.decimals)
    body = chain(extent, _skeleton(hand), *(_mesh(hand, part) for part in parts))
    return _prim(f'SkelRoot "{hand.name}"', [], body)


def _skeleton(hand: _Hand) -> Iterator[str]:
    motion = hand.motion
    custom: dict[str, dict[str, Any]] = {}
    for index, joint in enumerate(motion.joints):
        known = {"name": joint.name, **joint_facts(motion, index)}
        custom[hand.joints[index].rpartition("/")[2]] = known
    local_mm = np.concatenate([hand.rest_mm[:1], motion.rest_offset_mm[1:]])
    local_turn = np.concatenate([hand.rest_turn[:1], motion.rest_rotation[1:]])

    body = [
        f"uniform matrix4d[] bindTransforms = {_matrices(hand.rest_mm * hand.scale, hand.rest_turn)}",
        f"uniform token[] joints = {_strings(hand.joints)}",
        f"uniform matrix4d[] restTransforms = {_matrices(local_mm * hand.scale, local_turn)}",
        f"rel skel:animationSource = </World/{hand.name}/{hand.skeleton}/motion>",
    ]
    metadata = ['prepend apiSchemas = ["SkelBindingAPI"]', *_within(_entries(custom), "customData = {", "}")]
    return _prim(f'Skeleton "{hand.skeleton}"', metadata, chain(body, _animation(hand)))


def _animation(hand: _Hand) -> Iterator[str]:
    local = local_motion(hand.motion)
    joints = f"uniform token[] joints = {_strings(hand.joints)}"
    scales = f"half3[] scales = {_listed(['(1, 1, 1)'] * len(hand.joints))}"
    place = _samples("float3[] translations", hand.codes, local.offset_mm, 3, hand.decimals, hand.scale)
    turn = _samples("quatf[] rotations", hand.codes, local.quaternion, 4, TURN_DECIMALS)
    return _prim('SkelAnimation "motion"', [], chain([joints, scales], place, turn))


def _body(hand: _Hand) -> list[_Part]:
    """The body (`shukotsu.stages.export.bone_mesh`) by material; there may be no nails."""
    mesh = bone_mesh(hand.motion)
    parts = []
    for kind, triangles in (("bone", mesh.bone), ("nail", mesh.nail)):
        if len(triangles):
            kept, place = np.unique(triangles, return_inverse=True)
            own = mesh.position_mm[kept], mesh.normal[kept], mesh.joint[kept]
            parts.append(_Part(kind, *own, place.reshape(-1, 3)))
    return parts


def _mesh(hand: _Hand, part: _Part) -> Iterator[str]:
    stand = hand.rest_turn[0]
    points = (hand.rest_mm[0] + rotate(stand, part.position_mm)) * hand.scale
    colour, triangles = _COLOURS[part.kind][0], part.triangle

    def body() -> Iterator[str]:
        yield f"float3[] extent = {_tuples(np.stack([points.min(0), points.max(0)]), hand.decimals)}"
        yield f"int[] faceVertexCounts = {_listed(['3'] * len(triangles))}"
        yield f"int[] faceVertexIndices = {_listed(map(str, triangles.ravel().tolist()))}"
        yield f"rel material:binding = </World/materials/{part.kind}>"
        normals = _tuples(rotate(stand, part.normal), TURN_DECIMALS)
        yield from _within(['interpolation = "vertex"'], f"normal3f[] normals = {normals} (", ")")
        yield f"point3f[] points = {_tuples(points, hand.decimals)}"
        yield f"color3f[] primvars:displayColor = [{_tuple(colour)}]"
        yield f"matrix4d primvars:skel:geomBindTransform = {_AS_IT_IS}"
        weighting = ["elementSize = 1", 'interpolation = "vertex"']
        joints = _listed(map(str, part.joint.tolist()))
        yield from _within(weighting, f"int[] primvars:skel:jointIndices = {joints} (", ")")
        weights = _listed(["1"] * len(part.joint))
        yield from _within(weighting, f"float[] primvars:skel:jointWeights = {weights} (", ")")
        yield f"rel skel:skeleton = </World/{hand.name}/{hand.skeleton}>"
        yield 'uniform token subdivisionScheme = "none"'

    metadata = ['prepend apiSchemas = ["SkelBindingAPI", "MaterialBindingAPI"]']
    yield from _prim(f'Mesh "{hand.name}_{part.kind}s"', metadata, body())


def _material(kind: str) -> Iterator[str]:
    colour, roughness = _COLOURS[kind]
    shader = [
        'uniform token info:id = "UsdPreviewSurface"',
        f"color3f inputs:diffuseColor = {_tuple(colour)}",
        f"float inputs:roughness = {roughness}",
        "token outputs:surface",
    ]

    connection = f"token outputs:surface.connect = </World/materials/{kind}/surface.outputs:surface>"
    return _prim(f'Material "{kind}"', [], [connection, *_prim('Shader "surface"', [], shader)])


def _extent(hand: _Hand, parts: Sequence[_Part]) -> Array:
    """Least and greatest coordinates (T, 2, 3) of all vertices in every frame, or a little beyond.

    Those of the boxes that hold every joint's vertices in its bone frame, which are far fewer to turn.
    """
    motion = hand.motion
    points = np.concatenate([part.position_mm for part in parts])
    riders = np.concatenate([part.joint for part in parts])
    rest_mm, rest_turn = rest_pose(motion)
    least = np.full((len(motion.frame), 3), np.inf)
    greatest = -least
    for index in range(len(motion.joints)):
        own = (points[riders == index] - rest_mm[index]) @ matrix(rest_turn[index])
        turn = matrix(motion.quaternion[:, index])
        middle, half = (own.max(0) + own.min(0)) / 2, (own.max(0) - own.min(0)) / 2
        centre = motion.position_mm[:, index] + turn @ middle
        reach = np.abs(turn) @ half
        least, greatest = np.minimum(least, centre - reach), np.maximum(greatest, centre + reach)
    return np.stack([least, greatest], 1) * hand.scale


def _remarks(motions: Sequence[SkeletonMotion]) -> tuple[str, ...]:
    sentences = []
    late_s = max(largest_time_error_s(motion) for motion in motions)
    if late_s > _NOTABLE_S:
        sentences.append(
            f"samples at whole time codes: device times are up to {late_s * 1000:.1f} ms off an even rate, "
            "and samples lie at them; --fps resamples to whole time codes"
        )
    if len(motions) > 1:
        sentences.append(
            f"what {len(motions)} hands did at once: each begins at time code 0, as of recordings that were "
            "made one after the other"
        )
    return tuple(sentences)


def _prim(what: str, metadata: Sequence[str], body: Iterable[str]) -> Iterator[str]:
    """Lines of a prim: its type and name, what stands in its parentheses, what in its braces."""
    if metadata:
        yield from _within(metadata, f"def {what} (", ")")
    else:
        yield f"def {what}"
    yield from _within(body, "{", "}")


def _within(lines: Iterable[str], opening: str, closing: str) -> Iterator[str]:
    """Lines a level deeper, between two others."""
    yield opening
    for line in lines:
        yield _INDENT + line
    yield closing


def _samples(
    what: str, codes: Array, values: Array, width: int, decimals: int, scale: float = 1.0
) -> Iterator[str]:
    """Lines of an array attribute over time: values (T, N, width) times scale as N tuples a time code."""
    numbers = f"({', '.join([f'%.{decimals}f'] * width)})"
    pattern = f"[{', '.join([numbers] * values.shape[1])}],"

    def lines() -> Iterator[str]:
        for start in range(0, len(codes), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            for code, row in zip(codes[rows], values[rows] * scale, strict=True):
                yield f"{_code(code)}: {pattern % tuple(row.ravel().tolist())}"

    yield from _within(lines(), f"{what}.timeSamples = {{", "}")


def _entries(values: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a dictionary; None is left out."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _within(_entries(value), f"dictionary {key} = {{", "}")
        elif isinstance(value, str):
            yield f"string {key} = {_quoted(value)}"
        elif isinstance(value, int):
            yield f"int64 {key} = {value}"
        elif isinstance(value, float):
            yield f"double {key} = {value!r}"
        elif isinstance(value, list):
            yield f"string[] {key} = {_strings(value)}"
        elif value is not None:
            yield f"double3 {key} = {_tuple(value.round(9).tolist())}"


def _code(code: float) -> str:
    return f"{code:.{CODE_DECIMALS}f}".rstrip("0").rstrip(".")


def _tuple(values: Iterable[float]) -> str:
    return f"({', '.join(f'{value:.9g}' for value in values)})"


def _tuples(values: Array, decimals: int) -> str:
    """An array (N, K) as N tuples."""
    numbers = f"({', '.join([f'%.{decimals}f'] * values.shape[1])})"
    return f"[{', '.join([numbers] * len(values))}]" % tuple(values.ravel().tolist())


def _matrices(place: Array, turn: Array) -> str:
    """Transforms as USD has them, of row vectors: places (N, 3) in the file's unit, quaternions (N, 4)."""
    rows = np.tile(np.eye(4), (len(place), 1, 1))
    rows[:, :3, :3] = matrix(turn).transpose(0, 2, 1)
    rows[:, 3, :3] = place
    return _listed(f"({_tuples(each, 10)[1:-1]})" for each in rows)


def _strings(values: Iterable[str]) -> str:
    return _listed(map(_quoted, values))


def _listed(texts: Iterable[str]) -> str:
    return f"[{', '.join(texts)}]"


def _quoted(text: str) -> str:
    """A string between quotes, on one line."""
    kept = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else _escaped(c) for c in kept) + '"'


def _escaped(character: str) -> str:
    return "".join(f"\\x{byte:02x}" for byte in character.encode())
