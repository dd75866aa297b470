"""Runs in Blender's own Python, not in ours: an exported GLB file -> FBX (docs/blender.md).

blender --background --python stages/export/blender_to_fbx.py -- hand.glb hand.fbx

With bpy from pip in a Python of its own: python stages/export/blender_to_fbx.py hand.glb hand.fbx
"""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path
from typing import Any


def convert(glb: Path, fbx: Path) -> None:
    """Write the file's hands, bodies and motion as FBX, a key a frame at the rate of the recording.

    Joints keep their frames, as the file has them: -Z along the bone, +Y out of its back.
    """
    import bpy  # type: ignore[import-not-found]  # only Blender has it

    bpy.ops.wm.read_factory_settings(use_empty=True)
    set_rate(bpy.context.scene, rate_hz(glb))
    bpy.ops.import_scene.gltf(filepath=str(glb), bone_heuristic="BLENDER")
    play_all(bpy.context.scene)
    bpy.ops.export_scene.fbx(
        filepath=str(fbx),
        object_types={"ARMATURE", "MESH"},
        add_leaf_bones=False,
        bake_anim_use_nla_strips=False,
        bake_anim_use_all_actions=False,
        bake_anim_simplify_factor=0.0,
    )


def rate_hz(glb: Path) -> float:
    """Frames a second of the recording, as the file's provenance tells; 60 where it tells none."""
    with glb.open("rb") as stream:
        magic, _, _, length, _ = struct.unpack("<4sIII4s", stream.read(20))
        if magic != b"glTF":
            sys.exit(f"{glb}: is no GLB file; expected one that was exported with --formats glb")
        facts = json.loads(stream.read(length))["asset"].get("extras", {}).get("motions", [{}])
    return float(facts[0].get("rate_hz") or 60.0)


def set_rate(scene: Any, rate: float) -> None:
    """Set the scene to that rate, so that its whole frames are the recording's."""
    scene.render.fps = max(1, round(rate))
    scene.render.fps_base = scene.render.fps / rate


def play_all(scene: Any) -> None:
    """Let every armature play its own motion, not only those of the first animation, over all its frames."""
    last = 0.0
    for armature in (thing for thing in scene.objects if thing.type == "ARMATURE"):
        data = armature.animation_data
        strip = data.nla_tracks[0].strips[0]
        action, slot = strip.action, strip.action_slot
        for track in list(data.nla_tracks):
            data.nla_tracks.remove(track)
        data.action, data.action_slot = action, slot
        last = max(last, action.frame_range[1])
    scene.frame_start, scene.frame_end = 0, round(last)


if __name__ == "__main__":
    argv = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    if len(argv) != 2:
        sys.exit(__doc__)
    convert(Path(argv[0]), Path(argv[1]))
