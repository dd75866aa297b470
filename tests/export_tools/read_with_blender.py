"""Print the joints of a BVH, GLB or FBX file as Blender reads them, as JSON. Runs in Blender's Python.

usage: python read_with_blender.py FILE RATE_HZ; RATE_HZ 0 uses the file's rate

{"joints": {ARMATURE: {JOINT: [[x, y, z] per frame]}}, "ends": the same for the ends of bones without
children, "bodies": {ARMATURE: vertices in the last frame, unordered}}, all with +Y up instead of Blender's
+Z, in m or, for BVH, in the file's unit.
"""

import json
import sys
from pathlib import Path

import bpy

REPORT = sys.stdout
sys.stdout = sys.stderr  # Blender prints its progress to stdout


def upright(point):
    """Convert a point from Blender's axes, with z up, to axes with y up."""
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
    """Return the vertices of the meshes that the armature moves, in their moved positions."""
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
    mesh.hide_viewport = True  # to skip its evaluation in every frame
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
