#!/usr/bin/env python3
"""Renders a mesh as Blender does without settings: the startup scene, with the mesh in place of the cube.

The mesh is centred and scaled to the cube's size, since the lamp's distance is fixed. The camera keeps its direction,
and moves until the mesh fits. Cycles renders the picture, since Blender's other renderer needs a display.

Usage: blender.py MESH PICTURE WIDTH HEIGHT. Needs Blender's module from PyPI (`pip install bpy`).
"""
import math
import sys
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

IMPORTERS = {".obj": bpy.ops.wm.obj_import, ".stl": bpy.ops.wm.stl_import, ".ply": bpy.ops.wm.ply_import,
             ".glb": bpy.ops.import_scene.gltf}
RADIUS_OF_CUBE = math.sqrt(3)


def corners_of(objects):
    """Returns the corners of the objects' bounding boxes."""
    bpy.context.view_layer.update()
    return [thing.matrix_world @ Vector(corner) for thing in objects if thing.type == "MESH" for corner in thing.bound_box]


def main():
    mesh, picture, size = Path(sys.argv[1]), sys.argv[2], [int(side) for side in sys.argv[3:5]]
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    before = set(bpy.data.objects)
    IMPORTERS[mesh.suffix](filepath=str(mesh))
    objects = [thing for thing in bpy.data.objects if thing not in before]
    corners = corners_of(objects)
    low, high = (Vector(map(end, zip(*corners))) for end in (min, max))
    scale = RADIUS_OF_CUBE / ((high - low).length / 2)
    for thing in objects:
        if thing.parent is None:
            thing.matrix_world = Matrix.Scale(scale, 4) @ Matrix.Translation((low + high) / -2) @ thing.matrix_world
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    # `camera_fit_coords` wants the coordinates of all points in one list.
    coordinates = [coordinate for corner in corners_of(objects) for coordinate in corner]
    scene.camera.location, _ = scene.camera.camera_fit_coords(bpy.context.evaluated_depsgraph_get(), coordinates)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 64
    scene.render.filepath = picture
    bpy.ops.render.render(write_still=True)


main()
