"""GLB export: the mesh of the hand, and joints and mesh as read by other programs.

The programs are in .tools at the repository's root or the folder SHUKOTSU_TOOLS: node_modules (installed by
tests/export_tools/package.json) and blender/bin/python with bpy. A test without its program is skipped.
"""

import json
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import watched
from guide_pages import blocks
from moving_fingers import moving_fingers
from program_files import printed_by
from simulated_hands import FITTED, REPLAYED, SimulatedHand

from shukotsu.export.exported_motion import rest_pose
from shukotsu.export.glb import bone_mesh, write
from shukotsu.export.rigging import with_webxr_names
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import conjugate, rotate

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "other-programs.md"


@contextmanager
def served(page: str, glb: Path, modules: Path, folder: Path) -> Iterator[str]:
    """Serve a page with the file and the modules beside it, as in the guide, and yield its address."""
    (folder / "index.html").write_text(page, "utf-8")
    (folder / "favicon.ico").touch()  # browsers request it
    (folder / "hand.glb").write_bytes(glb.read_bytes())
    (folder / "node_modules").symlink_to(modules.resolve(), target_is_directory=True)
    files = partial(SimpleHTTPRequestHandler, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), files) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}/"
        finally:
            server.shutdown()
            thread.join()


SCRIPTS = Path(__file__).resolve().parents[1] / "export_tools"
ExportTool = Callable[[str], Path]
NEAR_M = 3e-7
"""Tolerance of joint positions; the requirement is 1e-6."""


def read_in_node(export_tool: ExportTool, file: Path) -> Any:
    """Return what three.js reads from a file, after checking that the Khronos validator has no message."""
    modules = export_tool("node_modules/three").parent
    content = json.loads(printed_by("node", SCRIPTS / "read_glb.mjs", modules, file))
    assert content["messages"] == [], "neither errors, warnings nor information"
    return content


def read_in_blender(export_tool: ExportTool, file: Path, rate_hz: float) -> Any:
    words = export_tool("blender/bin/python"), SCRIPTS / "read_with_blender.py", file, rate_hz
    return json.loads(printed_by(*words))


def assert_joints(joints: Any, motion: PosedRecording, near_m: float, rows: slice = slice(None)) -> None:
    """Check that every joint is present under its WebXR name at the motion's position in the given frames."""
    motion = with_webxr_names(motion)
    assert set(joints) == set(motion.names)
    positions = np.stack([joints[name] for name in motion.names], 1)
    np.testing.assert_allclose(positions, motion.position_mm[rows] / 1000, atol=near_m)


def last_body(motion: PosedRecording) -> np.ndarray:
    """Return the mesh's vertices (V, 3) in m in the last frame; each is fixed to a joint."""
    motion = with_webxr_names(motion)
    mesh, (rest_mm, rest_turn) = bone_mesh(motion), rest_pose(motion)
    on_bone = rotate(conjugate(rest_turn[mesh.joint]), mesh.position_mm - rest_mm[mesh.joint])
    return (rotate(motion.quaternion[-1, mesh.joint], on_bone) + motion.position_mm[-1, mesh.joint]) / 1000


def test_the_mesh_is_closed_and_faces_outward() -> None:
    mesh = bone_mesh(moving_fingers(1))
    triangles = mesh.position_mm[mesh.bone]
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.linalg.norm(across, axis=1).min() > 0
    facing = mesh.normal[mesh.bone].mean(1)
    assert ((across * facing).sum(-1) > 0).all()
    corner = {tuple(p): i for i, p in enumerate(np.unique(mesh.position_mm.round(6), axis=0))}
    index = np.array([corner[tuple(p)] for p in mesh.position_mm.round(6)])[mesh.bone]
    edges = np.concatenate([index[:, [0, 1]], index[:, [1, 2]], index[:, [2, 0]]])
    there, back = sorted(map(tuple, edges)), sorted((b, a) for a, b in edges)
    assert there == back, "every edge occurs once in each direction"
    assert np.linalg.det(triangles).sum() > 0, "its volume is positive"


@pytest.mark.tools
@pytest.mark.parametrize("model", [REPLAYED, FITTED])
def test_three_reads_every_joint_and_the_validator_has_no_message(
    hand: SimulatedHand, tmp_path: Path, export_tool: ExportTool, model: str
) -> None:
    motion, file = hand.ready(model), tmp_path / "hand.glb"
    write(motion, file)
    content = read_in_node(export_tool, file)
    name = f"{motion.origin.recording.hand}-hand"
    clip = content["clips"][f"{name} opposition"]
    np.testing.assert_allclose(clip["times"], motion.time_s - motion.time_s[0], atol=1e-5)
    assert_joints(clip["joints"][name], motion, NEAR_M)
    expected = last_body(motion)
    for primitive in ("1", "2"):
        np.testing.assert_allclose(content["bodies"][f"{name}-body_{primitive}"], expected, atol=2e-6)


@pytest.mark.tools
def test_the_validator_has_no_message_about_unusual_files(tmp_path: Path, export_tool: ExportTool) -> None:
    """The files have one frame, names in other scripts, or a skeleton that is not a hand."""
    file, motion = tmp_path / "odd.glb", moving_fingers(20)
    write(motion.take(slice(0, 1)), file)
    assert len(read_in_node(export_tool, file)["clips"]["right-made wave"]["times"]) == 1
    joints = tuple(replace(joint, name=f"腕 {i}") for i, joint in enumerate(motion.joints))
    write(replace(motion, joints=joints, origin=replace(motion.origin, licence="© 手")), file)
    joints_m = read_in_node(export_tool, file)["clips"]["right-made wave"]["joints"]["right-made"]
    np.testing.assert_allclose(joints_m["腕 3"], motion.position_mm[:, 3] / 1000, atol=NEAR_M)


@pytest.mark.tools
@pytest.mark.parametrize("model", [REPLAYED, FITTED])
def test_blender_reads_every_joint_and_the_mesh(
    hand: SimulatedHand, tmp_path: Path, export_tool: ExportTool, model: str
) -> None:
    motion, file = hand.ready(model), tmp_path / "hand.glb"
    write(motion, file)
    name = f"{motion.origin.recording.hand}-hand"
    content = read_in_blender(export_tool, file, motion.rate_hz)
    assert_joints(content["joints"][name], motion, NEAR_M)
    body, expected = np.array(content["bodies"][name]), last_body(motion)
    assert len(body) == len(expected)
    np.testing.assert_allclose(body.min(0), expected.min(0), atol=2e-6)
    np.testing.assert_allclose(body.max(0), expected.max(0), atol=2e-6)


@pytest.mark.tools
def test_blenders_fbx_has_every_joint(hand: SimulatedHand, tmp_path: Path, export_tool: ExportTool) -> None:
    motion, glb, fbx = hand.ready(FITTED), tmp_path / "hand.glb", tmp_path / "hand.fbx"
    write(motion, glb)
    script = tmp_path / "fbx.py"
    script.write_text(blocks(GUIDE, "python")[0].text)
    printed_by(export_tool("blender/bin/python"), script, glb, fbx)
    name = f"{motion.origin.recording.hand}-hand"
    assert_joints(read_in_blender(export_tool, fbx, 0)["joints"][name], motion, 1e-4)


@pytest.mark.tools
def test_the_guides_page_shows_the_moving_hand(
    right: SimulatedHand, tmp_path: Path, export_tool: ExportTool, browser: Any
) -> None:
    """The page requests nothing from elsewhere; only slow software rendering may cause warnings."""
    motion, file = right.ready(FITTED), tmp_path / "motion.glb"
    write(motion, file)
    modules = export_tool("node_modules/three").parent
    with (
        served(blocks(GUIDE, "html")[0].text, file, modules, tmp_path) as address,
        watched(browser, viewport={"width": 400, "height": 300}) as watch,
    ):
        page = watch.page
        page.goto(address)
        shows_another = "seen => !['', ...seen].includes(document.querySelector('output').textContent)"
        seen: list[str] = []
        for _ in range(3):  # three different frames, at any drawing speed
            page.wait_for_function(shows_another, arg=seen)
            seen.append(page.locator("output").text_content())
        picture = page.screenshot()
        watch.console = [text for text in watch.console if not re.search("GPU stall|rAF timed out", text)]
        watch.opened |= {url for url in watch.requests if url.startswith(address)}
    assert len(picture) > 5000, "a page without a hand is smaller"
    tips = motion.position_mm[:, [motion.index("thumb_skin_tip"), motion.index("index_skin_tip")]]
    apart_mm, time_s = (tips[:, 0] - tips[:, 1]).T, motion.time_s - motion.time_s[0]
    for words in seen:
        seconds, shown_mm = map(float, re.findall(r"[\d.]+", words))
        rounded_s = seconds + np.linspace(-5e-4, 5e-4, 11)
        at = np.linalg.norm([np.interp(rounded_s, time_s, part_mm) for part_mm in apart_mm], axis=0)
        assert at.min() - 0.06 <= shown_mm <= at.max() + 0.06
