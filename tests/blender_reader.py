"""Runs Blender's importers: `blender_reader.py FOLDER ROWS` writes the place of each joint over time to places.npz."""

import sys
from pathlib import Path

import bpy
import numpy as np

folder, rows = Path(sys.argv[1]), int(sys.argv[2])
found = {}
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_anim.bvh(filepath=str(folder / "animation.bvh"), global_scale=0.01, rotate_mode="NATIVE")
armature = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
names = [bone.name for bone in armature.pose.bones]
places = np.empty((rows, len(names), 3))
for row in range(rows):
    bpy.context.scene.frame_set(row + 1)
    places[row] = [armature.matrix_world @ bone.head for bone in armature.pose.bones]
found |= {f"bvh_{name}": places[:, k] for k, name in enumerate(names)}

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
bpy.ops.import_scene.gltf(filepath=str(folder / "animation.glb"))
last = max(action.frame_range[1] for action in bpy.data.actions)
for row in range(rows):
    frame = last * row / (rows - 1)
    scene.frame_set(int(frame), subframe=frame - int(frame))
    for thing in bpy.data.objects:
        found.setdefault(f"glb_{thing.name}", np.empty((rows, 3)))[row] = thing.matrix_world.translation
# Blender has Z up: (x, y, z) of a file is (x, -z, y) there.
np.savez(folder / "places.npz", **{name: place[:, [0, 2, 1]] * [1, 1, -1] for name, place in found.items()})
print("joints:", len(found))
