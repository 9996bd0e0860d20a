#!/usr/bin/env python3
"""Makes docs/images/beside-viewers.jpg: ten meshes, each as f3d, Blender and raycl show it by default, side by side.

Usage: tests/viewers/sheet.py RAYCL FOLDER. Needs f3d and xvfb-run (`apt install f3d xvfb xauth`), and Pillow and Blender
from PyPI (`pip install pillow bpy`).
"""
import math
import struct
import subprocess
import sys
from pathlib import Path

from PIL import Image

REPOSITORY = Path(__file__).resolve().parents[2]
SIZE = (400, 250)
# The factor by which pictures are scaled on the sheet.
SCALE = 0.6
# The space in pixels between the two meshes of a row.
GAP = 8


def write_obj(path, points, faces):
    lines = ["v {:.5f} {:.5f} {:.5f}".format(*point) for point in points]
    lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")


def knot(path, along=400, around=24):
    """A tube around a trefoil knot, without normals."""
    def centre(t):
        return [(2 + math.cos(3 * t)) * math.cos(2 * t), (2 + math.cos(3 * t)) * math.sin(2 * t), -math.sin(3 * t)]

    def unit(vector):
        return [x / math.hypot(*vector) for x in vector]

    points = []
    for i in range(along):
        t = 2 * math.pi * i / along
        x, y, z = unit([b - a for a, b in zip(centre(t), centre(t + 1e-3))])
        side = unit([y, -x, 0])
        up = [y * side[2] - z * side[1], z * side[0] - x * side[2], x * side[1] - y * side[0]]
        for turn in (2 * math.pi * j / around for j in range(around)):
            offset = (math.cos(turn) * s + math.sin(turn) * u for s, u in zip(side, up))
            points.append([c + 0.4 * o for c, o in zip(centre(t), offset)])
    at = lambda i, j: i % along * around + j % around
    faces = [[at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)] for i in range(along) for j in range(around)]
    write_obj(path, points, faces)


def gear(path, teeth=24):
    """A gear whose axis is z, in millimetres, as programs for 3D printing write it."""
    def at(radius, number, height):
        turn = 2 * math.pi * number / (4 * teeth)
        return radius * math.cos(turn), radius * math.sin(turn), height

    triangles = []
    for i in range(4 * teeth):
        (a, b), (c, d) = ([[at(radius, n, z) for z in (0, 15)] for n, radius in zip((i, i + 1), ends)]
                          for ends in (([40, 40, 34, 34][i % 4], [40, 34, 34, 40][i % 4]), (12, 12)))
        for p, q, r, s in ((a[0], b[0], b[1], a[1]), (d[0], c[0], c[1], d[1]),
                           (a[1], b[1], d[1], c[1]), (b[0], a[0], c[0], d[0])):
            triangles += [(p, q, r), (p, r, s)]
    bodies = (struct.pack("<12fH", 0, 0, 0, *sum(triangle, ()), 0) for triangle in triangles)
    path.write_bytes(bytes(80) + struct.pack("<I", len(triangles)) + b"".join(bodies))


def wave(path, side=120):
    """A wave with a colour per vertex."""
    coordinates = [6 * i / (side - 1) - 3 for i in range(side)]
    lines = []
    for x, z in ((x, z) for z in coordinates for x in coordinates):
        y = 1.2 * math.sin(3 * math.hypot(x, z)) / (1 + x * x + z * z)
        tone = round(120 * math.tanh(2 * y))
        lines.append(f"{x:.4f} {y:.4f} {z:.4f} {127 + tone} 120 {127 - tone}")
    at = lambda i, j: i * side + j
    cells = [(i, j) for i in range(side - 1) for j in range(side - 1)]
    faces = [f"4 {at(i, j)} {at(i + 1, j)} {at(i + 1, j + 1)} {at(i, j + 1)}" for i, j in cells]
    head = ["ply", "format ascii 1.0", f"element vertex {len(lines)}", *(f"property float {axis}" for axis in "xyz"),
            *(f"property uchar {colour}" for colour in ("red", "green", "blue")), f"element face {len(faces)}",
            "property list uchar int vertex_indices", "end_header"]
    path.write_text("\n".join(head + lines + faces) + "\n")


def chair(path):
    """A chair of boxes: four legs, a seat, three slats."""
    boxes = [(x, 0, z, x + 0.05, 0.45 if z else 1, z + 0.05) for x in (0, 0.42) for z in (0, 0.42)]
    boxes += [(-0.01, 0.45, -0.01, 0.48, 0.49, 0.48)]
    boxes += [(0.05, y, 0.01, 0.42, y + 0.07, 0.04) for y in (0.6, 0.75, 0.9)]
    sides = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    points = [(box[3 * i], box[3 * j + 1], box[3 * k + 2])
              for box in boxes for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    write_obj(path, points, [[8 * n + corner for corner in side] for n in range(len(boxes)) for side in sides])


def main():
    raycl, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for make, name in ((knot, "knot.obj"), (gear, "gear.stl"), (wave, "wave.ply"), (chair, "chair.obj")):
        make(folder / name)
    subprocess.run([sys.executable, REPOSITORY / "scenes/untuned.py", folder], check=True, stdout=subprocess.DEVNULL)
    meshes = [folder / name for name in ("knot.obj", "gear.stl", "wave.ply", "chair.obj")]
    meshes += [REPOSITORY / "scenes/table/globe.obj", REPOSITORY / "tests/data/meshes/two.glb"]
    meshes += [folder / f"{name}.obj" for name in ("boxes", "spheres", "terrain", "leaves")]
    width, height = (round(side * SCALE) for side in SIZE)
    sheet = Image.new("RGB", (6 * width + GAP, len(meshes) // 2 * height), "white")
    for number, mesh in enumerate(meshes):
        pictures = by_f3d(mesh, folder), by_blender(mesh, folder), by_raycl(raycl, mesh, folder)
        for column, picture in enumerate(pictures):
            picture = Image.open(picture).convert("RGB").resize((width, height), Image.Resampling.LANCZOS)
            sheet.paste(picture, (number % 2 * (3 * width + GAP) + column * width, number // 2 * height))
    sheet.save(REPOSITORY / "docs/images/beside-viewers.jpg", quality=80)


def by_f3d(mesh, folder):
    picture = folder / f"{mesh.stem}-f3d.png"
    size = ",".join(map(str, SIZE))
    subprocess.run(["xvfb-run", "-a", "f3d", "--quiet", "--resolution", size, "--output", picture, mesh], check=True)
    return picture


def by_blender(mesh, folder):
    picture = folder / f"{mesh.stem}-blender.png"
    script = Path(__file__).with_name("blender.py")
    command = [sys.executable, script, mesh, picture, *map(str, SIZE)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return picture


def by_raycl(raycl, mesh, folder):
    picture = folder / f"{mesh.stem}-raycl.png"
    size = ["--width", str(SIZE[0]), "--height", str(SIZE[1])]
    subprocess.run([raycl, "render", mesh, "-o", picture, *size, "--force", "--quiet"], check=True)
    return picture


main()
