"""Joints of a BVH, GLB, FBX or USD file as Blender has them, as JSON on stdout. Runs in Blender's Python.

usage: python read_with_blender.py FILE RATE_HZ; RATE_HZ 0: that of the file

{"joints": {ARMATURE: {JOINT: [[x, y, z], ... a frame]}}, "ends": the same of the ends of bones that nothing
hangs from, "bodies": {ARMATURE: vertices in the last frame, in no particular order}}, all turned back from
Blender's world to +Y up, in the file's unit (of BVH) or m.
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


def read(file):
    """Read a file into the empty scene."""
    if file.suffix == ".bvh":
        axes = {"axis_forward": "-Z", "axis_up": "Y"}
        bpy.ops.import_anim.bvh(filepath=str(file), rotate_mode="NATIVE", use_fps_scale=False, **axes)
    elif file.suffix == ".fbx":
        bpy.ops.import_scene.fbx(filepath=str(file))
    else:
        bpy.ops.import_scene.gltf(filepath=str(file))


def body(armature, meshes, graph):
    """Vertices of the meshes that the armature moves, as it moves them."""
    points = []
    for mesh in meshes:
        if armature in [modifier.object for modifier in mesh.modifiers if modifier.type == "ARMATURE"]:
            moved = mesh.evaluated_get(graph)
            points += [upright(moved.matrix_world @ vertex.co) for vertex in moved.to_mesh().vertices]
    return points


rate_hz = float(sys.argv[2])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
if rate_hz:
    scene.render.fps = round(rate_hz)
    scene.render.fps_base = scene.render.fps / rate_hz
read(Path(sys.argv[1]))
armatures = [thing for thing in scene.objects if thing.type == "ARMATURE"]
ranges = [thing.animation_data.action.frame_range for thing in armatures if thing.animation_data.action]
meshes = [thing for thing in scene.objects if thing.type == "MESH"]
for mesh in meshes:
    mesh.hide_viewport = True  # not worked out in every frame
joints = {armature.name: {bone.name: [] for bone in armature.pose.bones} for armature in armatures}
ends = {armature.name: {bone.name: [] for bone in armature.pose.bones} for armature in armatures}
for frame in range(round(min(first for first, _ in ranges)), round(max(last for _, last in ranges)) + 1):
    scene.frame_set(frame)
    for armature in armatures:
        for bone in armature.pose.bones:
            joints[armature.name][bone.name].append(upright(armature.matrix_world @ bone.head))
            if not bone.children:
                ends[armature.name][bone.name].append(upright(armature.matrix_world @ bone.tail))
for mesh in meshes:
    mesh.hide_viewport = False
graph = bpy.context.evaluated_depsgraph_get()
graph.update()
bodies = {armature.name: body(armature, meshes, graph) for armature in armatures}
json.dump({"joints": joints, "ends": ends, "bodies": bodies}, REPORT)
