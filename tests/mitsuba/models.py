"""Makes the meshes and pictures of courtyard.toml, lamps.toml and studio.toml from formulas."""
import math

import mitsuba as mi
import numpy as np


def texel_centres(width, height):
    """The centres of a picture's texels, from 0 to 1, from its upper left corner."""
    return np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)


def save(path, *channels):
    """Writes a picture of 8 bits per channel; values are display values from 0 to 1."""
    values = np.stack(np.broadcast_arrays(*channels), axis=-1)
    mi.Bitmap(np.clip(255 * values + 0.5, 0, 255).astype(np.uint8)).write(str(path))


def tiles(folder):
    """Four tiles of four colours, so that a mirrored or turned picture is noticed."""
    u, v = texel_centres(64, 64)
    right, low = u > 0.5, v > 0.5
    line = (np.abs((2 * u) % 1 - 0.5) > 0.46) | (np.abs((2 * v) % 1 - 0.5) > 0.46)
    red = np.where(right, 0.95, 0.7) - 0.2 * low
    save(folder / "tiles.png", *(np.where(line, 0.3, value) for value in (red, 0.85 - 0.2 * low, 0.65 + 0.3 * low)))


def stripes(folder):
    """Slanted stripes that turn from blue to yellow, and fine lines across."""
    u, v = texel_centres(128, 64)
    wave = 0.5 + 0.5 * np.sin(2 * math.pi * (4 * u + 2 * v))
    line = 0.12 * (np.sin(2 * math.pi * 16 * u) > 0.9)
    save(folder / "stripes.png", 0.4 + 0.5 * v * wave - line, 0.5 + 0.4 * wave - line, 0.95 - 0.5 * v - line)


def masks(folder):
    """A lattice, whose brightness is the mask, and a leaf with round holes in its alpha channel."""
    u, v = texel_centres(48, 48)
    bars = np.minimum(np.abs((3 * (u + v)) % 1 - 0.5), np.abs((3 * (u - v)) % 1 - 0.5))
    lattice = np.clip(4 * (0.25 - bars), 0, 1)
    save(folder / "lattice.png", lattice, lattice, lattice)
    u, v = texel_centres(32, 32)
    alpha = np.clip(8 * (np.hypot((2 * u) % 1 - 0.5, (2 * v) % 1 - 0.5) - 0.27) + 0.5, 0, 1)
    save(folder / "leaf.png", 0.35 + 0.4 * u, 0.75 - 0.3 * v, 0.2 + 0.2 * v, alpha)


def sky(folder):
    """A sky with a sun of soft edges, a red window to the right and a green one behind, over a dark ground."""
    u, v = texel_centres(512, 256)
    turn, height = 2 * math.pi * (u - 0.5), math.pi * (0.5 - v)
    directions = np.stack([np.cos(height) * np.sin(turn), np.sin(height), -np.cos(height) * np.cos(turn)], axis=-1)

    def lobe(direction, sharpness):
        direction = np.array(direction) / np.linalg.norm(direction)
        return np.exp(sharpness * (directions @ direction - 1))[..., None]

    up = directions[..., 1:2]
    base = np.where(up > 0, [0.3, 0.4, 0.6] + 0.2 * up * [-1, -0.5, 1], [0.12, 0.1, 0.08])
    lights = 9 * lobe([-1, 1.2, 0.6], 60) * [1, 0.9, 0.7] + 2 * lobe([2, 0.6, -0.3], 20) * [1, 0.2, 0.1]
    mi.Bitmap((base + lights + lobe([0.3, 0.4, 2], 20) * [0.1, 1, 0.2]).astype(np.float32)).write(str(folder / "sky.exr"))


def mesh(folder, name, material, faces):
    """Writes an OBJ of one material; a face is a list of corners, each a position, a texture coordinate, a normal."""
    known, lines = [{}, {}, {}], []
    for face in faces:
        texts = [[" ".join(f"{x + 0.0:.6g}" for x in np.round(part, 6)) for part in corner] for corner in face]
        numbers = [[known[i].setdefault(text, len(known[i]) + 1) for i, text in enumerate(c)] for c in texts]
        lines.append("f " + " ".join("/".join(map(str, corner)) for corner in numbers))
    points = [f"{word} {text}" for word, texts in zip(("v", "vt", "vn"), known) for text in texts]
    (folder / f"{name}.mtl").write_text(f"newmtl {name}\n{material}\n")
    (folder / f"{name}.obj").write_text("\n".join([f"mtllib {name}.mtl", f"usemtl {name}", *points, *lines]) + "\n")


def square(corner, right, up, times=(1, 1)):
    """A parallelogram, on which the picture is repeated `times` across and up."""
    corner, right, up = (np.array(vector, dtype=float) for vector in (corner, right, up))
    normal = np.cross(right, up) / np.linalg.norm(np.cross(right, up))
    ends = ((0, 0), (1, 0), (1, 1), (0, 1))
    return [(corner + s * right + t * up, (s * times[0], t * times[1]), normal) for s, t in ends]


def box():
    """A cube of side 1 that stands on the ground, around the y axis."""
    x, y, z = np.eye(3)
    for right, up in ((x, y), (-x, y), (z, y), (-z, y), (x, -z), (x, z)):
        yield square((y + np.cross(right, up) - right - up) / 2, right, up)


def ball(rows=48, columns=96):
    """A ball of radius 1, with its picture once around."""
    def corner(i, j):
        polar, turn = math.pi * i / rows, 2 * math.pi * j / columns
        normal = np.array([math.sin(polar) * math.cos(turn), math.cos(polar), -math.sin(polar) * math.sin(turn)])
        return normal, (j / columns, 1 - i / rows), normal

    for i in range(rows):
        for j in range(columns):
            face = [corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1), corner(i, j)]
            yield face[1:] if i == rows - 1 else face[:3] if i == 0 else face


def tube(columns=96):
    """A tube of radius 1 and height 2 around the y axis, with its picture three times around."""
    def corner(j, height):
        turn = 2 * math.pi * j / columns
        normal = np.array([math.sin(turn), 0, math.cos(turn)])
        return normal + (0, height, 0), (3 * j / columns, height), normal

    return [[corner(j, 0), corner(j + 1, 0), corner(j + 1, 2), corner(j, 2)] for j in range(columns)]


def make(folder):
    """Writes all meshes and pictures into a folder."""
    for write in (tiles, stripes, masks, sky):
        write(folder)
    mesh(folder, "floor", "map_Kd tiles.png", [square((-4, 0, 4), (8, 0, 0), (0, 0, -8), (6, 6))])
    mesh(folder, "wall", "Kd 0.9 0.8 0.7\nmap_Kd stripes.png", [square((-4, 0, -2.5), (8, 0, 0), (0, 3.5, 0), (3, 2))])
    mesh(folder, "box", "Kd 0.75 0.7 0.65", box())
    mesh(folder, "ball", "Kd 0.95 0.95 0.95\nmap_Kd stripes.png", ball())
    mesh(folder, "fence", "Kd 0.7 0.5 0.4\nmap_d lattice.png", [square((0, 0, 0), (2, 0, 0), (0, 1.4, 0), (3, 2))])
    mesh(folder, "leaf", "map_Kd leaf.png\nmap_d leaf.png", [square((-1, 0, 1), (2, 0, 0), (0, 0.5, -2), (2, 2))])
    mesh(folder, "tube", "Kd 0.6 0.7 0.8\nmap_d lattice.png", tube())
    poster = square((-1, -1, 0), (2, 0, 0), (0, 2, 0), (2, 2))
    mesh(folder, "poster", "map_Kd -clamp on stripes.png", [[(p, np.array(uv) - 0.5, n) for p, uv, n in poster]])
