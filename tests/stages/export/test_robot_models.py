"""URDF and MJCF: forward kinematics over the table of joints gives the hand, by a reader of our own and by
programs of robotics.
"""

from __future__ import annotations

import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from export_samples.moving_fingers import moving_fingers, random_fingers
from scipy.spatial.transform import Rotation

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.export.motion import SkeletonMotion
from shukotsu.stages.export.registry import FORMATS, write_format
from shukotsu.stages.export.rig_names import plain_names
from shukotsu.stages.export.settings import Settings, prepared

READER = Path(__file__).resolve().parents[2] / "export_samples" / "readers" / "read_with_robotics.py"
STIFF = Settings(stiff=True, gaps="cut")
EXACT = Settings(gaps="cut")
NEAR_M = 1e-7


def numbers(text: str | None, default: str = "0 0 0") -> Array:
    return np.array((text or default).split(), float)


def transform(turn: Rotation, place: Array) -> Array:
    made = np.tile(np.eye(4), (*turn.as_matrix().shape[:-2], 1, 1))
    made[..., :3, :3], made[..., :3, 3] = turn.as_matrix(), place
    return made


def moved(kind: str, axis: Array, values: Array) -> Array:
    """Transforms (T, 4, 4) of a joint of one degree of freedom."""
    if kind in ("prismatic", "slide"):
        return transform(Rotation.identity(len(values)), values[:, None] * axis)
    return transform(Rotation.from_rotvec(values[:, None] * axis), np.zeros((len(values), 3)))


def urdf_places(path: Path, table: dict[str, Array]) -> dict[str, Array]:
    """Positions (T, 3) m of all links."""
    frames = len(table["time_s"])
    poses = {"transmitter": np.tile(np.eye(4), (frames, 1, 1))}
    for joint in ET.parse(path).getroot().iter("joint"):
        parent, child, origin = (joint.find(tag) for tag in ("parent", "child", "origin"))
        assert parent is not None
        assert child is not None
        assert origin is not None
        turn = Rotation.from_euler("xyz", numbers(origin.get("rpy")))
        pose = poses[parent.get("link", "")] @ transform(turn, numbers(origin.get("xyz")))
        axis = joint.find("axis")
        if axis is not None:
            pose = pose @ moved(joint.get("type", ""), numbers(axis.get("xyz")), table[joint.get("name", "")])
        poses[child.get("link", "")] = pose
    return {name: pose[:, :3, 3] for name, pose in poses.items()}


def mjcf_places(path: Path, table: dict[str, Array]) -> dict[str, Array]:
    """Positions (T, 3) m of all bodies and sites."""
    places = {}

    def below(element: ET.Element, pose: Array) -> None:
        for body in element.findall("body"):
            turn = Rotation.from_quat(numbers(body.get("quat")), scalar_first=True)
            own = pose @ transform(turn, numbers(body.get("pos")))
            for joint in body.findall("joint"):
                own = own @ moved(
                    joint.get("type", ""), numbers(joint.get("axis")), table[joint.get("name", "")]
                )
            places[body.get("name", "")] = own[:, :3, 3]
            for site in body.findall("site"):
                places[site.get("name", "")] = own[:, :3, 3] + own[:, :3, :3] @ numbers(site.get("pos"))
            below(body, own)

    world = ET.parse(path).getroot().find("worldbody")
    assert world is not None
    below(world, np.tile(np.eye(4), (len(table["time_s"]), 1, 1)))
    return places


def written(motion: SkeletonMotion, settings: Settings, name: str, folder: Path) -> tuple[Path, Path]:
    """The model and its table, as the export writes them."""
    path = folder / f"a{FORMATS[name].extensions[0]}"
    write_format([motion], settings, name, path)
    return path, folder / f"a{FORMATS[name].extensions[1]}"


def read_table(path: Path) -> dict[str, Array]:
    names = path.read_text("ascii").splitlines()[0].split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2).T, strict=True))


def assert_places(places: dict[str, Array], motion: SkeletonMotion, *, tips: bool) -> None:
    """Every joint is where the motion has it, and every tip where bones are stiff."""
    names = {}
    kept = [index for index, joint in enumerate(motion.joints) if not joint.tip]
    bodies = plain_names(motion.joints[index].segment for index in kept)
    names |= dict(zip(bodies, kept, strict=True))
    if tips:
        names |= {joint.name: index for index, joint in enumerate(motion.joints) if joint.tip}
    assert len(names) >= len(bodies) > 2
    for name, index in names.items():
        off_m = np.abs(places[name] - motion.position_mm[:, index] / 1000).max()
        assert off_m < NEAR_M, (name, off_m)


@pytest.mark.parametrize("name", ["urdf", "mjcf"])
@pytest.mark.parametrize("slip_mm", [0.0, 0.7])
def test_joints_are_where_they_were(name: str, slip_mm: float, tmp_path: Path) -> None:
    for number, motion in enumerate(
        (moving_fingers(40, slip_mm=slip_mm), random_fingers(20, seed=3, slip_mm=slip_mm))
    ):
        (tmp_path / str(number)).mkdir()
        model, table = written(motion, EXACT, name, tmp_path / str(number))
        places = {"urdf": urdf_places, "mjcf": mjcf_places}[name](model, read_table(table))
        assert_places(
            places, prepared(motion, EXACT, holds_gaps=False, up="z"), tips=not slip_mm and not number
        )


@pytest.mark.parametrize("name", ["urdf", "mjcf"])
@pytest.mark.parametrize("settings", [EXACT, STIFF])
@pytest.mark.parametrize("model", [FITTED, REPLAYED])
def test_a_hand_is_where_its_tables_have_it(
    known: KnownHand, name: str, settings: Settings, model: str, tmp_path: Path
) -> None:
    file, table = written(known.motion(model), settings, name, tmp_path)
    places = {"urdf": urdf_places, "mjcf": mjcf_places}[name](file, read_table(table))
    motion = prepared(known.motion(model), settings, holds_gaps=False, up="z")
    assert_places(places, motion, tips=settings.stiff)


@pytest.mark.tools
@pytest.mark.parametrize("name", ["urdf", "mjcf"])
@pytest.mark.parametrize("settings", [EXACT, STIFF])
def test_programs_of_robotics_have_every_joint_where_it_is(
    known: KnownHand, name: str, settings: Settings, tmp_path: Path, export_tool: Callable[[str], Path]
) -> None:
    model, table = written(known.motion(FITTED), settings, name, tmp_path)
    python = export_tool("robotics/bin/python")
    words = [python, READER, model, table, tmp_path / "places.npz"]
    subprocess.run(list(map(str, words)), check=True, capture_output=True, timeout=300)
    places = dict(np.load(tmp_path / "places.npz"))
    assert_places(
        places, prepared(known.motion(FITTED), settings, holds_gaps=False, up="z"), tips=settings.stiff
    )
