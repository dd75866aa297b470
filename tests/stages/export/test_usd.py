"""A USD file holds skeleton, body and motion: read by a reader of our own, by OpenUSD and by Blender.

The programs are usd/bin/python with usd-core and numpy, and blender/bin/python with bpy, in .tools or where
SHUKOTSU_TOOLS says; a test is skipped without its program.
"""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from export_samples.moving_fingers import both_hands, moving_fingers, random_fingers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shukotsu.skeleton.rotations import matrix
from shukotsu.stages.export.axes import UNITS_PER_MM, Target
from shukotsu.stages.export.bone_mesh import bone_mesh
from shukotsu.stages.export.motion import SkeletonMotion, rest_pose
from shukotsu.stages.export.rigging import with_webxr_names
from shukotsu.stages.export.usd import write, write_scene

BLENDER = Path(__file__).resolve().parents[2] / "export_tools" / "read_with_blender.py"
METRES, CENTIMETRES = Target("m", "y"), Target("cm", "z")
NEAR_M = 3e-7
"""Of float32; asked for is 1e-6."""
NEAR_BLENDER_M = 1e-6
"""Asked for is 1e-5."""


@dataclass
class Prim:
    """A prim of a USD text file; values are text but for samples: by attribute (codes, arrays)."""

    kind: str
    values: dict[str, str] = field(default_factory=dict)
    samples: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    prims: dict[str, Prim] = field(default_factory=dict)

    def array(self, name: str) -> np.ndarray:
        """Numbers of an attribute."""
        return numbers(self.values[name])

    def words(self, name: str) -> list[str]:
        """Strings of an attribute."""
        found: list[str] = json.loads(self.values[name])
        return found

    def one(self, kind: str) -> Prim:
        """The only prim of a kind below this one."""
        (found,) = (prim for prim in self.prims.values() if prim.kind == kind)
        return found


def numbers(words: str) -> np.ndarray:
    return np.array(json.loads(words.replace("(", "[").replace(")", "]")), float)


def read_usda(path: Path) -> Prim:
    """The file's prims; of the layer itself, kind is its first line and values are its metadata."""
    lines = path.read_text("utf-8").splitlines()
    top = Prim(lines[0])
    stack, opened = [top], top
    metadata, samples = False, ""
    for line in map(str.strip, lines[1:]):
        if samples:
            if line == "}":
                samples = ""
                continue
            code, _, value = line.rstrip(",").partition(": ")
            codes, arrays = opened.samples.setdefault(samples, ([], []))
            codes.append(float(code))
            arrays.append(numbers(value))
        elif line.endswith(".timeSamples = {"):
            samples = line.split(".")[0]
        elif metadata:
            metadata = line != ")"
            name, _, value = line.partition(" = ")
            # all in one, whatever dictionary it is in; of the same in several the first
            opened.values.setdefault(name, value)
        elif made := re.fullmatch(r'def (\w+) "(\w+)"( \()?', line):
            opened = stack[-1].prims[made[2]] = Prim(made[1])
            metadata = bool(made[3])
        elif line in ("{", "}"):
            stack = [*stack, opened] if line == "{" else stack[:-1]
            opened = stack[-1]
        elif line == "(":
            metadata = True
        else:
            name, _, value = line.partition(" = ")
            metadata = value.endswith(" (")
            stack[-1].values[name.split()[-1]] = value.removesuffix(" (")
    for prim in every(top):
        prim.samples = {name: (np.array(c), np.stack(a)) for name, (c, a) in prim.samples.items()}
    return top


def every(prim: Prim) -> list[Prim]:
    return [prim, *chain.from_iterable(every(below) for below in prim.prims.values())]


def hand_of(layer: Prim, motion: SkeletonMotion) -> Prim:
    """The motion's SkelRoot."""
    what = "hand" if np.isfinite(motion.neutral).any() else motion.origin.layout
    hand = layer.prims["World"].prims[f"{motion.origin.hand}_{what}"]
    assert hand.kind == "SkelRoot"
    return hand


def posed(hand: Prim) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, J, 3) in the file's unit and rotations (T, J, 3, 3) of a SkelRoot's joints."""
    animation = hand.one("Skeleton").one("SkelAnimation")
    names = animation.words("joints")
    assert names == hand.one("Skeleton").words("joints")
    assert (animation.array("scales") == np.ones((len(names), 3))).all()
    _, place = animation.samples["float3[] translations"]
    _, turn = animation.samples["quatf[] rotations"]
    place, local = place.astype(np.float32).astype(float), turn.astype(np.float32)
    own = (
        Rotation.from_quat(np.roll(local, -1, -1).reshape(-1, 4)).as_matrix().reshape(*local.shape[:2], 3, 3)
    )
    points, frames = place.copy(), own.copy()
    for index, name in enumerate(names):
        if "/" in name:
            above = names.index(name.rpartition("/")[0])
            points[:, index] = points[:, above] + np.einsum("tij,tj->ti", frames[:, above], place[:, index])
            frames[:, index] = frames[:, above] @ own[:, index]
    return points, frames


def written(motion: SkeletonMotion, folder: Path, target: Target = METRES) -> Prim:
    """The motion's SkelRoot of a file that is written."""
    write(motion, target, folder / "motion.usda")
    return hand_of(read_usda(folder / "motion.usda"), motion)


def assert_joints(points: Any, motion: SkeletonMotion, near_m: float) -> None:
    """Positions (T, J, 3) in m are those of the motion."""
    assert len(points) == len(motion.frame)
    np.testing.assert_allclose(points, motion.position_mm / 1000, rtol=0, atol=near_m)


def test_the_layer_says_its_units_axis_and_times(known: KnownHand, tmp_path: Path) -> None:
    for target, metres in ((METRES, "1"), (CENTIMETRES, "0.01"), (Target("mm", "y"), "0.001")):
        motion = with_webxr_names(known.ready(up=target.up))
        write(motion, target, tmp_path / "a.usda")
        layer = read_usda(tmp_path / "a.usda")
        assert layer.kind == "#usda 1.0"
        assert layer.values["metersPerUnit"] == metres
        assert layer.values["upAxis"] == f'"{target.up.upper()}"'
        assert layer.values["timeCodesPerSecond"] == layer.values["framesPerSecond"] == "240"
        assert layer.values["startTimeCode"] == "0"
        assert layer.values["endTimeCode"] == str(len(motion.frame) - 1)
        assert layer.values["defaultPrim"] == '"World"'
        hand = hand_of(layer, motion)
        for prim in every(hand):
            for codes, _ in prim.samples.values():
                np.testing.assert_array_equal(codes, np.arange(len(motion.frame)))
        assert [len(prim.samples) for prim in every(hand)] == [1, 0, 2, 0, 0]


def test_the_body_goes_with_the_bones_and_extents_hold_it(known: KnownHand, tmp_path: Path) -> None:
    motion = with_webxr_names(known.ready(up="z"))
    hand = written(motion, tmp_path, CENTIMETRES)
    skeleton, side = hand.one("Skeleton"), motion.origin.hand
    bind = skeleton.array("bindTransforms")
    place, frames = posed(hand)
    mesh = bone_mesh(motion)
    rest_mm, rest_turn = rest_pose(motion)
    moved = []
    for name, triangles in (("bones", mesh.bone), ("nails", mesh.nail)):
        part = hand.prims[f"{side}_hand_{name}"]
        assert part.kind == "Mesh"
        points, riders = part.array("points"), part.array("primvars:skel:jointIndices").astype(int)
        assert (part.array("primvars:skel:jointWeights") == 1).all()
        assert part.array("faceVertexCounts").tolist() == [3] * len(triangles)
        corners = part.array("faceVertexIndices").astype(int)
        own = np.einsum("vi,vij->vj", np.c_[points, np.ones(len(points))], np.linalg.inv(bind)[riders])[:, :3]
        turn = Rotation.from_quat(np.roll(rest_turn, -1, -1)).as_matrix()
        kept = triangles.ravel()
        ours = mesh.position_mm[kept] - rest_mm[mesh.joint[kept]]
        expected = np.einsum("vji,vj->vi", turn[mesh.joint[kept]], ours)
        np.testing.assert_allclose(own[corners] * 10, expected, atol=1e-4)
        np.testing.assert_array_equal(riders[corners], mesh.joint[kept])
        assert np.linalg.norm(part.array("normals"), axis=1) == pytest.approx(1)
        np.testing.assert_allclose(part.array("extent"), [points.min(0), points.max(0)])
        moved.append(np.einsum("tvij,vj->tvi", frames[:, riders], own) + place[:, riders])
    everything = np.concatenate(moved, 1)
    _, extent = hand.samples["float3[] extent"]
    assert (extent[:, 0] <= everything.min(1) + 1e-4).all()
    assert (extent[:, 1] >= everything.max(1) - 1e-4).all()
    assert np.abs(extent - np.stack([everything.min(1), everything.max(1)], 1)).max() < 2, (
        "cm: about as large"
    )


@settings(max_examples=12)
@given(st.integers(1, 30), st.integers(0, 2**31), st.sampled_from([0.0, 0.7]))
def test_any_motion_comes_back(
    tmp_path_factory: pytest.TempPathFactory, n: int, seed: int, slip: float
) -> None:
    motion = random_fingers(n, seed, slip)
    points, frames = posed(written(motion, tmp_path_factory.mktemp("any")))
    assert_joints(points, motion, 1e-6)
    np.testing.assert_allclose(frames, matrix(motion.quaternion), atol=3e-6)


READ_WITH_OPENUSD = """
import json, sys
import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, UsdValidation

stage = Usd.Stage.Open(sys.argv[1])
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
names = [validator.GetMetadata().name for validator in validators]
errors = UsdValidation.ValidationContext(validators).Validate(stage)
unit = UsdGeom.GetStageMetersPerUnit(stage)
found = {
    "validators": names,
    "errors": [error.GetMessage() for error in errors],
    "unit": unit,
    "up": str(UsdGeom.GetStageUpAxis(stage)),
    "rate": stage.GetTimeCodesPerSecond(),
    "range": [stage.GetStartTimeCode(), stage.GetEndTimeCode()],
    "default": str(stage.GetDefaultPrim().GetPath()),
    "known": {k: dict(v) for k, v in stage.GetRootLayer().customLayerData.items()},
    "hands": {},
}
for prim in stage.Traverse():
    if not prim.IsA(UsdSkel.Root):
        continue
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(prim), Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(UsdSkel.Root(prim), Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(binding.GetSkeleton())
    times = query.GetAnimQuery().GetJointTransformTimeSamples()
    joints, beyond = [], 0.0
    boxes = UsdGeom.BBoxCache(Usd.TimeCode(0), ["default", "render"])
    for code in times:
        world = query.ComputeJointSkelTransforms(code)
        joints.append([[v * unit for v in m.ExtractTranslation()] for m in world])
        boxes.SetTime(code)
        box = boxes.ComputeWorldBound(prim).ComputeAlignedRange()
        body = []
        for skinning in binding.GetSkinningTargets():
            mesh = UsdGeom.Mesh(skinning.GetPrim())
            points = mesh.GetPointsAttr().Get()
            moving = query.ComputeSkinningTransforms(code)
            assert skinning.ComputeSkinnedPoints(moving, points, code)
            points = np.array(points)
            beyond = max(beyond, (np.array(box.GetMin()) - points.min(0)).max())
            beyond = max(beyond, (points.max(0) - np.array(box.GetMax())).max())
            body += (points * unit).tolist()
    found["hands"][prim.GetName()] = {
        "names": [str(name) for name in query.GetJointOrder()],
        "times": list(times),
        "joints": joints,
        "body": body,
        "bind": query.HasBindPose() and query.HasRestPose(),
        "beyond_m": beyond * unit,
    }
json.dump(found, sys.stdout, default=list)
"""


def output_of(*words: str | Path) -> Any:
    """What a program says on stdout, which is JSON."""
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout[done.stdout.index("{") :])


@pytest.fixture(scope="session")
def openusd(export_tool: Callable[[str], Path]) -> Path:
    """A Python with OpenUSD."""
    return export_tool("usd/bin/python")


def in_openusd(openusd: Path, file: Path) -> Any:
    """What OpenUSD has of a file, on which its validators have no word."""
    found = output_of(openusd, "-c", READ_WITH_OPENUSD, file)
    assert {"usdSkelValidators:SkelBindingApiValidator", "usdGeomValidators:StageMetadataChecker"} <= set(
        found["validators"]
    )
    assert found["errors"] == []
    return found


@pytest.mark.tools
@pytest.mark.parametrize("target", [METRES, CENTIMETRES])
@pytest.mark.parametrize("model", [REPLAYED, FITTED])
def test_openusd_has_every_joint_and_the_body(
    known: KnownHand, tmp_path: Path, openusd: Path, model: str, target: Target
) -> None:
    motion, file = with_webxr_names(known.ready(model, up=target.up)), tmp_path / "hand.usda"
    write(motion, target, file)
    found = in_openusd(openusd, file)
    assert (found["unit"], found["up"]) == (0.001 / UNITS_PER_MM[target.unit], target.up.upper())
    assert (found["rate"], found["default"]) == (240, "/World")
    assert found["range"] == [0, len(motion.frame) - 1]
    hand = found["hands"][f"{motion.origin.hand}_hand"]
    assert hand["bind"]
    assert_joints(hand["joints"], motion, NEAR_M)
    body, expected = np.array(hand["body"]), last_body(motion)
    np.testing.assert_allclose(body.min(0), expected.min(0), atol=1e-6)
    np.testing.assert_allclose(body.max(0), expected.max(0), atol=1e-6)
    assert hand["beyond_m"] < 1e-6, "extents hold the body"


def last_body(motion: SkeletonMotion) -> np.ndarray:
    """Vertices (V, 3) in m of the body in the last frame, from the motion alone."""
    mesh = bone_mesh(motion)
    rest_mm, rest_turn = rest_pose(motion)
    back = Rotation.from_quat(np.roll(rest_turn, -1, -1)[mesh.joint]).inv()
    own = back.apply(mesh.position_mm - rest_mm[mesh.joint])
    turn = matrix(motion.quaternion)[-1][mesh.joint]
    moved = np.einsum("vij,vj->vi", turn, own) + motion.position_mm[-1, mesh.joint]
    return np.asarray(moved / 1000)


@pytest.mark.tools
def test_openusd_takes_odd_files(tmp_path: Path, openusd: Path) -> None:
    """One frame, uneven times, names and words of any script, two hands."""
    file, made = tmp_path / "odd.usda", moving_fingers(20)
    write(made.take(slice(0, 1)), METRES, file)
    assert_joints(in_openusd(openusd, file)["hands"]["right_made"]["joints"], made.take(slice(0, 1)), NEAR_M)
    names = ("腕", "3d", "a-b", "a_b", 'say "\\', "")
    joints = tuple(replace(joint, name=name) for joint, name in zip(made.joints, names, strict=True))
    licence = '© "手" \\ \' a\nb\tc\x07d\u200b @ # $'
    odd = replace(made, joints=joints, origin=replace(made.origin, licence=licence))
    odd = replace(odd, time_s=odd.time_s**1.1)
    write(odd, METRES, file)
    found = in_openusd(openusd, file)
    assert found["known"]["right_made"]["licence"] == licence
    assert_joints(found["hands"]["right_made"]["joints"], odd, NEAR_M)
    np.testing.assert_allclose(found["hands"]["right_made"]["times"], odd.time_s * 100, atol=1e-6)
    write_scene(both_hands(4.0, 50.0), METRES, file)
    found = in_openusd(openusd, file)["hands"]
    for motion in both_hands(4.0, 50.0):
        assert_joints(found[f"{motion.origin.hand}_made"]["joints"], motion, NEAR_M)


@pytest.mark.tools
@pytest.mark.parametrize("target", [METRES, CENTIMETRES])
def test_blender_has_every_joint_and_the_body(
    known: KnownHand, tmp_path: Path, export_tool: Callable[[str], Path], target: Target
) -> None:
    motion, file = with_webxr_names(known.ready(up=target.up)), tmp_path / "hand.usda"
    write(motion, target, file)
    found = output_of(export_tool("blender/bin/python"), BLENDER, file, "0")
    name = f"{motion.origin.hand}_hand_skeleton"
    joints = {bone.replace("_", "-"): series for bone, series in found["joints"][name].items()}
    points, body = np.stack([joints[own] for own in motion.names], 1), np.array(found["bodies"][name])
    if target.up == "z":  # the reader gives y up
        points, body = (a[..., [0, 2, 1]] * [1, -1, 1] for a in (points, body))
    expected = last_body(motion)
    assert_joints(points, motion, NEAR_BLENDER_M)
    np.testing.assert_allclose(body.min(0), expected.min(0), atol=2e-6)
    np.testing.assert_allclose(body.max(0), expected.max(0), atol=2e-6)
