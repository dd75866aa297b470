"""Joints of a GLB or FBX file as Blender has them, as JSON on stdout. Runs in Blender's Python.

usage: python read_with_blender.py FILE RATE_HZ; RATE_HZ 0: that of the file (FBX)

{ARMATURE: {JOINT: [[x, y, z], ... a frame]}} in m, turned back from Blender's world to +Y up, and for every
armature's body, under ARMATURE-body, its vertices in the last frame, in no particular order.
"""

import json
import sys
from pathlib import Path

import bpy

REPORT = sys.stdout
sys.stdout = sys.stderr  # Blender tells its progress there, and the numbers are to stand alone


def upright(point):
    """A point of Blender's world, which has z up, in one that has y up."""
    return [point.x, point.z, -point.y]


def body(armature, graph):
    """Vertices of the meshes that the armature moves, as it moves them."""
    points = []
    for mesh in (thing for thing in bpy.context.scene.objects if thing.parent == armature):
        moved = mesh.evaluated_get(graph)
        points += [upright(moved.matrix_world @ vertex.co) for vertex in moved.to_mesh().vertices]
    return points


file, rate_hz = Path(sys.argv[1]), float(sys.argv[2])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
if rate_hz:
    scene.render.fps = round(rate_hz)
    scene.render.fps_base = scene.render.fps / rate_hz
if file.suffix == ".fbx":
    bpy.ops.import_scene.fbx(filepath=str(file))
else:
    bpy.ops.import_scene.gltf(filepath=str(file))
armatures = [thing for thing in scene.objects if thing.type == "ARMATURE"]
moving = [armature for armature in armatures if armature.animation_data.action]
first = min(armature.animation_data.action.frame_range[0] for armature in moving)
last = max(armature.animation_data.action.frame_range[1] for armature in moving)
meshes = [thing for thing in scene.objects if thing.type == "MESH"]
for mesh in meshes:
    mesh.hide_viewport = True  # not worked out in every frame
found = {armature.name: {bone.name: [] for bone in armature.pose.bones} for armature in armatures}
for frame in range(round(first), round(last) + 1):
    scene.frame_set(frame)
    for armature in armatures:
        for bone in armature.pose.bones:
            found[armature.name][bone.name].append(upright(armature.matrix_world @ bone.head))
for mesh in meshes:
    mesh.hide_viewport = False
graph = bpy.context.evaluated_depsgraph_get()
graph.update()
bodies = {f"{armature.name}-body": body(armature, graph) for armature in armatures}
json.dump({"joints": found, "bodies": bodies}, REPORT)
