"""Positions of all joints and end sites of a BVH file as Blender has them, as JSON. Runs in its own venv."""

import json
import sys
from pathlib import Path

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(
    filepath=sys.argv[1], axis_forward="-Z", axis_up="Y", rotate_mode="NATIVE", use_fps_scale=False
)
armature = bpy.context.object
scene = bpy.context.scene
first, last = (round(value) for value in armature.animation_data.action.frame_range)
found = {"joints": {}, "ends": {}}
for frame in range(first, last + 1):
    scene.frame_set(frame)
    for bone in armature.pose.bones:
        world = armature.matrix_world @ bone.head
        found["joints"].setdefault(bone.name, []).append([world.x, world.z, -world.y])
        if not bone.children:
            world = armature.matrix_world @ bone.tail
            found["ends"].setdefault(bone.name, []).append([world.x, world.z, -world.y])
Path(sys.argv[2]).write_text(json.dumps(found), "utf-8")
