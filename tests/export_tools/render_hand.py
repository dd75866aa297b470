"""Draws the picture of docs/blender.md: exported hands from the back and from the palm, on 10 mm squares.

Runs in Blender's Python: python render_hand.py OUT.png FRAME LEFT.glb RIGHT.glb

Every hand is turned by the places of its joints and by the side in its name: a hand that was written as the
other one would show its nails in the palm.
"""

import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

SQUARE_M, WIDE_M, TALL_M, BEHIND_M = 0.01, 0.19, 0.22, -0.15
PIXELS_PER_M = 1200
SAMPLES = 32
LEVELS = 21


def main(out, frame, files):
    """Render the files' hands in that frame, each from two sides, into one row."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    views = [(path, palm) for palm in (False, True) for path in files]
    for index, (path, palm) in enumerate(views):
        place = Vector(((index - (len(views) - 1) / 2) * WIDE_M, 0.0, 0.0))
        side = put_hand(path, frame, place, palm)
        write_words(
            f"{side}, {'palm' if palm else 'back'}",
            place + Vector((0, -TALL_M / 2 + 0.008, BEHIND_M + 0.002)),
        )
    draw_squares(len(views) * WIDE_M, TALL_M, BEHIND_M)
    light(len(views) * WIDE_M)
    render(out, len(views) * WIDE_M)


def put_hand(path, frame, place, palm):
    """Import a hand and lay it there as it is in that frame, fingers towards +Y; give its side."""
    scene = bpy.context.scene
    before = set(scene.objects)
    bpy.ops.import_scene.gltf(filepath=str(path))
    hand = next(thing for thing in set(scene.objects) - before if thing.type == "ARMATURE")
    scene.frame_set(frame)
    side = path.stem if path.stem in ("left", "right") else hand.name.split("-")[0]
    at = {bone.name: hand.matrix_world @ bone.head for bone in hand.pose.bones}
    wrist, middle = at["wrist"], at["middle-finger-phalanx-proximal"]
    across = at["pinky-finger-phalanx-proximal"] - at["index-finger-phalanx-proximal"]
    x = across if side == "right" else -across
    y = (middle - wrist).normalized()
    z = x.cross(y).normalized()
    turn = Matrix((y.cross(z), y, z)).to_4x4()
    if palm:
        turn = Matrix.Rotation(3.14159265, 4, "Y") @ turn
    middle_of_view = Vector((0.0, -TALL_M / 2 + 0.04, 0.0))
    hand.matrix_world = Matrix.Translation(place + middle_of_view) @ turn @ Matrix.Translation(-wrist)
    return side


def write_words(words, place):
    """Write words, as dark as print."""
    text = bpy.data.curves.new(words, "FONT")
    text.body, text.size, text.align_x = words, 0.012, "CENTER"
    text.materials.append(paint("words", (0.03, 0.03, 0.03, 1)))
    thing = bpy.data.objects.new(words, text)
    thing.location = place
    bpy.context.scene.collection.objects.link(thing)


def draw_squares(width, height, z):
    """Lines every 10 mm behind the hands, stronger ones every 100 mm."""
    bpy.ops.mesh.primitive_plane_add(size=1, location=(0, 0, z - 0.001))
    sheet = bpy.context.object
    sheet.scale = (width * 1.2, height * 1.2, 1)
    sheet.data.materials.append(paint("sheet", (0.9, 0.9, 0.9, 1)))
    for length, other, flat in ((width, height, False), (height, width, True)):
        for step in range(round(length / SQUARE_M) + 1):
            at = step * SQUARE_M - length / 2
            bpy.ops.mesh.primitive_plane_add(size=1, location=(0, at, z) if flat else (at, 0, z))
            line = bpy.context.object
            thick = 0.0012 if step % 10 == 0 else 0.0005
            line.scale = (other, thick, 1) if flat else (thick, other, 1)
            line.data.materials.append(paint("line", (0.45, 0.52, 0.6, 1)))


def paint(name, colour):
    """A material of that name that is as bright everywhere, shadows or not."""
    if name not in bpy.data.materials:
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        surface = made.node_tree.nodes["Principled BSDF"]
        surface.inputs["Base Color"].default_value = (0, 0, 0, 1)
        surface.inputs["Specular IOR Level"].default_value = 0.0
        surface.inputs["Emission Color"].default_value = colour
        surface.inputs["Emission Strength"].default_value = 1.0
    return bpy.data.materials[name]


def light(width):
    """A sun from the upper left, a bright sky, and a camera from above without perspective."""
    scene = bpy.context.scene
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.angle = 2.0, 0.3
    lamp = bpy.data.objects.new("sun", sun)
    lamp.rotation_euler = (-0.5, -0.5, 0.0)
    scene.collection.objects.link(lamp)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.6
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", width
    eye = bpy.data.objects.new("camera", camera)
    eye.location = (0, 0, 1)
    scene.collection.objects.link(eye)
    scene.camera = eye


def render(out, width):
    """By the processor, so that it needs no graphics card, in few levels, so that the file is small."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = True
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x = round(width * PIXELS_PER_M)
    scene.render.resolution_y = round(TALL_M * PIXELS_PER_M)
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.dither_intensity = 0.0
    scene.render.image_settings.compression = 100
    scene.render.filepath = str(out.absolute())
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath)
    levels = np.empty(len(picture.pixels), np.float32)
    picture.pixels.foreach_get(levels)
    picture.pixels.foreach_set(np.round(levels * LEVELS) / LEVELS)
    picture.file_format = "PNG"
    picture.save(filepath=scene.render.filepath, quality=100)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), [Path(word) for word in sys.argv[3:]])
