#!/usr/bin/env python3
"""Writes the meshes and pictures of scenes/table.toml into scenes/table/, with Python alone:

    scenes/table.py
"""
import math
import pathlib
import random
import struct
import zlib

FOLDER = pathlib.Path(__file__).parent / "table"


def write_png(name, width, height, colour):
    """Writes a picture of 8 bits per channel; colour(u, v) is red, green and blue, 0 to 1, with (0, 0) in the upper left."""
    rows = bytearray()
    for y in range(height):
        rows.append(0)
        for x in range(width):
            rgb = colour((x + 0.5) / width, (y + 0.5) / height)
            rows += bytes(max(0, min(255, round(255 * value))) for value in rgb)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    pieces = [chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(bytes(rows), 9)), chunk(b"IEND", b"")]
    (FOLDER / name).write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(pieces))


class Noise:
    """Smooth noise that repeats after `across` cells and `down` cells."""

    def __init__(self, across, down, seed):
        chance = random.Random(seed)
        self.size = (across, down)
        self.values = [[chance.random() for _ in range(across)] for _ in range(down)]

    def at(self, u, v):
        across, down = self.size
        x, y = u * across - 0.5, v * down - 0.5
        i, j = math.floor(x), math.floor(y)
        s, t = (d * d * (3 - 2 * d) for d in (x - i, y - j))
        corner = lambda column, row: self.values[row % down][column % across]
        upper = corner(i, j) * (1 - s) + corner(i + 1, j) * s
        lower = corner(i, j + 1) * (1 - s) + corner(i + 1, j + 1) * s
        return upper * (1 - t) + lower * t


def mixed(a, b, part):
    return tuple(x + (y - x) * part for x, y in zip(a, b))


def wood():
    """Four boards with their grain along u."""
    tone = [0.1, 0.65, 0.35, 0.9]
    waves, fine = Noise(3, 24, 1), Noise(6, 128, 2)

    def colour(u, v):
        board = int(v * 4)
        shift = u + 0.37 * board
        grain = 0.5 + 0.5 * math.sin(2 * math.pi * (12 * v + 3 * waves.at(shift, v)))
        part = 0.35 * grain + 0.35 * fine.at(shift, v) + 0.3 * tone[board]
        rgb = mixed((0.36, 0.20, 0.10), (0.72, 0.47, 0.27), part)
        gap = min(v * 4 - board, board + 1 - v * 4)
        return mixed((0.12, 0.06, 0.03), rgb, min(1.0, gap / 0.035))

    write_png("wood.png", 256, 256, colour)


def tile():
    """A glazed tile of blue on white: a star, petals, and a quarter of a ring in each corner."""
    glaze = Noise(8, 8, 3)

    def colour(u, v):
        x, y = 2 * u - 1, 2 * v - 1
        radius, angle = math.hypot(x, y), math.atan2(y, x)
        corner = math.hypot(1 - abs(x), 1 - abs(y))
        petals = abs(radius - 0.42 * (1.2 + 0.5 * math.cos(8 * angle))) < 0.045
        star = radius < 0.22 * (1.1 + 0.4 * math.cos(4 * angle))
        rings = 0.42 < corner < 0.50 or 0.18 < corner < 0.32
        rgb = (0.14, 0.27, 0.60) if petals or star or rings else (0.93, 0.94, 0.92)
        rgb = (0.86, 0.66, 0.22) if corner < 0.10 or radius < 0.07 else rgb
        rgb = mixed(rgb, (0.80, 0.86, 0.95), 0.25 * glaze.at(u, v))
        return (0.62, 0.60, 0.56) if max(abs(x), abs(y)) > 0.97 else rgb

    write_png("tile.png", 128, 128, colour)


def globe():
    """A globe with invented land and sea."""
    layers = [(Noise(4 << i, 2 << i, 11 + i), 0.5**i) for i in range(5)]

    def colour(u, v):
        # Towards the poles, the picture's columns become narrow on the globe. The noise is therefore weaker there.
        # Near the poles, ice covers land and sea.
        flat = math.sin(math.pi * v)
        height = sum(weight * (noise.at(u, v) - 0.5) for noise, weight in layers) * (0.4 + 0.6 * flat)
        ice = abs(v - 0.5) > 0.42 + 0.05 * height
        sea = mixed((0.10, 0.25, 0.45), (0.28, 0.52, 0.66), max(0.0, min(1.0, 1 + 4 * height)))
        land = mixed((0.60, 0.58, 0.30), (0.50, 0.34, 0.20), max(0.0, min(1.0, 3 * height)))
        rgb = (0.93, 0.94, 0.95) if ice else land if height > 0.06 else sea
        line = min(abs((24 * u) % 2 - 1), abs((12 * v) % 2 - 1) * 1.2)
        return mixed(rgb, (0.2, 0.2, 0.25), 0.35 if line < 0.035 else 0.0)

    write_png("globe.png", 512, 256, colour)


def write_obj(name, library, quads):
    """Writes quads with their materials. A quad has four corners, each with a position, texture coordinates and a normal."""
    sets, faces, used = {"v": {}, "vt": {}, "vn": {}}, [], None
    for material, corners in quads:
        if material != used:
            faces.append(f"usemtl {material}")
        used, face = material, []
        for corner in corners:
            texts = [" ".join(f"{round(x, 3) + 0.0:g}" for x in values) for values in corner]
            numbers = [known.setdefault(text, len(known) + 1) for known, text in zip(sets.values(), texts)]
            face.append("/".join(str(number) for number in numbers))
        faces.append("f " + " ".join(face))
    points = [f"{word} {text}" for word, known in sets.items() for text in known]
    (FOLDER / name).write_text("\n".join([f"mtllib {library}", *points, *faces]) + "\n")


def square(material, corner, right, up, times):
    """A parallelogram whose texture repeats `times` across and down."""
    cross = [right[i - 2] * up[i - 1] - right[i - 1] * up[i - 2] for i in range(3)]
    length = math.sqrt(sum(x * x for x in cross))
    normal = [x / length for x in cross]
    at = lambda s, t: [c + s * r + t * u for c, r, u in zip(corner, right, up)]
    texture = lambda s, t: (s * times[0], t * times[1])
    return material, [(at(s, t), texture(s, t), normal) for s, t in ((0, 0), (1, 0), (1, 1), (0, 1))]


def ball(material, rows, columns):
    """A unit ball with its texture once around it."""
    def corner(i, j):
        polar, turn = math.pi * i / rows, 2 * math.pi * j / columns
        normal = (math.sin(polar) * math.cos(turn), math.cos(polar), -math.sin(polar) * math.sin(turn))
        return normal, (j / columns, 1 - i / rows), normal

    for i in range(rows):
        for j in range(columns):
            yield material, [corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1), corner(i, j)]


def main():
    FOLDER.mkdir(exist_ok=True)
    wood(), tile(), globe()
    room = [
        square("boards", (-4, 0, 2.5), (8, 0, 0), (0, 0, -4.5), (2, 2)),
        square("tiles", (-4, 0, -2), (8, 0, 0), (0, 4, 0), (10, 5)),
    ]
    write_obj("room.obj", "table.mtl", room)
    write_obj("globe.obj", "table.mtl", ball("globe", 20, 40))
    materials = [("boards", 0.15, 30, "wood"), ("tiles", 0.3, 120, "tile"), ("globe", 0.12, 60, "globe")]
    text = [f"newmtl {name}\nKd 1 1 1\nKs {shine} {shine} {shine}\nNs {s}\nmap_Kd {picture}.png\n" for name, shine, s, picture in materials]
    (FOLDER / "table.mtl").write_text("\n".join(text))


main()
