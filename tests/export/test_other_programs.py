"""Programs that are not ours read a BVH file and have every joint where the tables have it, in every frame.

Skipped where a program is absent; CONTRIBUTING.md says how to get them.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand

from shukotsu.export.bvh import AT_REST
from shukotsu.export.registry import Settings, prepared, write_format

READERS = Path(__file__).resolve().parents[1] / "export_samples" / "readers"
BLENDER = READERS.parents[1] / "export_tools" / "read_with_blender.py"
NEAR_M = 1e-5
ExportTool = Callable[[str], Path]


def read_with(program: str, export_tool: ExportTool, file: Path) -> Any:
    """Series of joints and of ends that a program has of a file, by their names."""
    if program == "blender":
        words = [export_tool("blender/bin/python"), BLENDER, file, "0"]
        done = subprocess.run(list(map(str, words)), check=True, capture_output=True, timeout=300)
        found = json.loads(done.stdout)
        return {kind: next(iter(found[kind].values())) for kind in ("joints", "ends")}
    modules = export_tool("node_modules/three").parents[1]
    words = ["node", READERS / "read_with_three.mjs", modules]
    out = file.with_suffix(".json")
    subprocess.run(list(map(str, [*words, file, out])), check=True, capture_output=True, timeout=300)
    return json.loads(out.read_text("utf-8"))


def ends_of(joints: Any) -> dict[str, str]:
    """Tips by the joint before them."""
    return {joints[joint.parent].name: joint.name for joint in joints if joint.tip}


@pytest.mark.tools
@pytest.mark.parametrize("model", [REPLAYED, FITTED])
@pytest.mark.parametrize("program", ["three", "blender"])
@pytest.mark.parametrize("stiff", [True, False])
def test_a_program_has_every_joint_where_it_is(
    known: KnownHand, tmp_path: Path, export_tool: ExportTool, program: str, stiff: bool, model: str
) -> None:
    settings = Settings(stiff=stiff, gaps="cut", rig="webxr")
    motion = known.motion(model)
    write_format(motion, settings, "bvh", tmp_path / "motion.bvh")
    expected = prepared(motion, settings, holds_gaps=False, up="y")
    found = read_with(program, export_tool, tmp_path / "motion.bvh")
    tips = ends_of(expected.joints)
    series = found["joints"] | {tips[name]: end for name, end in found["ends"].items() if name in tips}
    assert {name for name in series if not name.endswith(AT_REST)} == set(expected.names)
    for index, name in enumerate(expected.names):
        off_m = np.abs(np.array(series[name]) / 100 - expected.position_mm[:, index] / 1000)
        assert off_m.shape == (len(expected.frame), 3)
        assert off_m.max() < NEAR_M, name
