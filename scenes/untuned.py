#!/usr/bin/env python3
"""Writes scenes that were not used to tune raycl (docs/log.md) into a folder, each as an OBJ and a TOML:

    scenes/untuned.py /tmp/untuned
    raycl render /tmp/untuned/atrium.toml --width 1920 --height 1080 --repeat 12
"""
import math
import pathlib
import random
import sys


class Mesh:
    """Positions, and triangles as triples of position indices; raycl computes the normals."""

    def __init__(self):
        self.positions, self.triangles = [], []

    def grid(self, rows, columns, at, turned=False):
        """A surface over the unit square: at(u, v) is a position. `turned` swaps its sides."""
        first = len(self.positions)
        self.positions += [at(i / rows, j / columns) for i in range(rows + 1) for j in range(columns + 1)]
        for i in range(rows):
            for j in range(columns):
                a = first + i * (columns + 1) + j
                c = a + columns + 1
                two = [(a, c, a + 1), (a + 1, c, c + 1)] if turned else [(a, a + 1, c), (a + 1, c + 1, c)]
                self.triangles += two

    def floor(self, half, height):
        self.grid(2, 2, lambda u, v: ((2 * u - 1) * half, height, (2 * v - 1) * half))

    def sphere(self, centre, radius, bands, sectors):
        def at(u, v):
            ring = radius * math.sin(math.pi * u)
            turn = 2 * math.pi * v
            x, y, z = centre
            return x + ring * math.cos(turn), y + radius * math.cos(math.pi * u), z + ring * math.sin(turn)

        self.grid(bands, sectors, at)

    def column(self, x, z, radius, height):
        """A fluted column."""

        def at(u, v):
            turn = 2 * math.pi * v
            ring = radius * (1 + 0.12 * math.cos(16 * turn))
            return x + ring * math.cos(turn), height * u, z + ring * math.sin(turn)

        self.grid(40, 128, at, turned=True)

    def arch(self, x, y, z):
        def at(u, v):
            ring = 1.25 + 0.15 * math.cos(2 * math.pi * v)
            along = math.pi * u
            return x - ring * math.cos(along), y + ring * math.sin(along), z + 0.15 * math.sin(2 * math.pi * v)

        self.grid(24, 24, at)

    def box(self, low, high):
        first = len(self.positions)
        self.positions += [tuple((high if k >> axis & 1 else low)[axis] for axis in range(3)) for k in range(8)]
        for q in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
            a, b, c, d = (first + k for k in q)
            self.triangles += [(a, b, c), (a, c, d)]

    def save(self, path):
        at = self.positions
        kept = [t for t in self.triangles if len({at[k] for k in t}) == 3]
        with open(path, "w") as out:
            out.writelines("v %.7g %.7g %.7g\n" % position for position in at)
            out.writelines("f %d %d %d\n" % tuple(k + 1 for k in t) for t in kept)
        return len(kept)


def ball(mesh):
    mesh.sphere((0, 0.5, 0), 0.5, 16, 31)


def boxes(mesh):
    for i in range(-35, 35):
        for j in range(-35, 35):
            height = random.random() ** 3 * 3 + 0.2
            mesh.box((i + 0.1, 0, j + 0.1), (i + 0.8, height, j + 0.8))
    mesh.floor(40, 0)


def atrium(mesh):
    mesh.grid(40, 40, lambda u, v: (24 * u - 12, 0, 12 * v - 6))
    mesh.grid(40, 40, lambda u, v: (24 * u - 12, 9 + 2 * math.sin(math.pi * v), 12 * v - 6), turned=True)
    for z in (-6, 6):
        waves = lambda u, v: 0.15 * math.sin(40 * u) * math.sin(20 * v)
        mesh.grid(60, 30, lambda u, v: (24 * u - 12, 9 * v, z + waves(u, v)), turned=z < 0)
    for x in (-12, 12):
        mesh.grid(30, 30, lambda u, v: (x, 9 * v, 12 * u - 6), turned=x > 0)
    for x in (2.5 * i - 10 for i in range(9)):
        for z in (-3.5, 3.5):
            mesh.column(x, z, 0.35, 5)
            mesh.sphere((x, 5.4, z), 0.5, 24, 40)
            mesh.arch(x + 1.25, 5.8, z)


def spheres(mesh):
    for _ in range(1000):
        centre = [random.uniform(-5, 5), random.uniform(0, 3), random.uniform(-5, 5)]
        mesh.sphere(centre, random.uniform(0.08, 0.3), 10, 16)
    mesh.floor(10, -0.4)


def terrain(mesh):
    waves = [0.7, 1.7, 3.9, 8.3, 17.0, 35.0]

    def height(x, z):
        return sum(math.sin(x * f + 1.3 * k) * math.cos(z * f * 1.1 + k) * 0.9 / f for k, f in enumerate(waves))

    mesh.grid(500, 500, lambda u, v: (20 * u - 10, height(20 * u, 20 * v), 20 * v - 10))


def leaves(mesh):
    for _ in range(200_000):
        towards = [random.gauss(0, 1) for _ in range(3)]
        reach = random.random() ** 0.4 / math.dist(towards, (0, 0, 0))
        first = len(mesh.positions)
        for _ in range(3):
            mesh.positions.append(tuple(x * reach + random.uniform(-0.02, 0.02) for x in towards))
        mesh.triangles.append((first, first + 1, first + 2))
    mesh.floor(2, -1.1)


def hair(mesh):
    """Strands of ten long triangles on the upper half of a ball, 0.002 wide at their roots."""
    for _ in range(30_000):
        turn, polar = random.uniform(0, 2 * math.pi), math.acos(random.uniform(0, 1))
        at = [math.sin(polar) * math.cos(turn), math.cos(polar), math.sin(polar) * math.sin(turn)]
        step = [x * 0.1 for x in at]
        side = (-math.sin(turn) * 0.002, 0, math.cos(turn) * 0.002)
        first = len(mesh.positions)
        for k in range(6):
            for sign in (-1, 1):
                mesh.positions.append(tuple(x + sign * s * (1 - k / 6) for x, s in zip(at, side)))
            step[1] -= 0.04
            step = [x + random.uniform(-0.01, 0.01) for x in step]
            at = [x + s for x, s in zip(at, step)]
        for k in range(first, first + 10, 2):
            mesh.triangles += [(k, k + 1, k + 2), (k + 1, k + 3, k + 2)]
    mesh.sphere((0, 0, 0), 0.98, 30, 60)


# The columns are: the function that makes the scene; the camera's position, target and vertical field of view in
# degrees; and the light's position.
SCENES = [
    (ball, [0, 1, 2], [0, 0.5, 0], 36, [2, 3, 2]),
    (boxes, [-30, 4, -30], [0, 0, 0], 50, [-20, 20, 10]),
    (atrium, [-11, 2.5, 0.5], [0, 3.5, 0], 60, [3, 7, 1]),
    (spheres, [7, 3.5, 9], [0, 1.2, 0], 45, [4, 12, 6]),
    (terrain, [-9, 3, -9], [0, 0, 0], 55, [3, 8, -6]),
    (leaves, [0, 0.6, 3.4], [0, 0, 0], 40, [3, 4, 3]),
    (hair, [0, 1.2, 4.5], [0, 0, 0], 40, [3, 5, 4]),
]

TOML = """[camera]
position = {position}
look_at = {look_at}
fov_y_degrees = {fov}

[[object]]
obj = "{name}.obj"
material = {{ k_l = 0.8 }}

[[light]]
position = {light}
power = {power:.0f}
"""


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) == 2 else sys.exit(__doc__))
    folder.mkdir(parents=True, exist_ok=True)
    for make, position, look_at, fov, light in SCENES:
        random.seed(7)
        name, mesh = make.__name__, Mesh()
        make(mesh)
        triangles = mesh.save(folder / f"{name}.obj")
        power = 1.8 * math.dist(light, look_at) ** 2  # the same brightness in each scene
        text = TOML.format(name=name, position=position, look_at=look_at, fov=fov, light=light, power=power)
        (folder / f"{name}.toml").write_text(text)
        print(f"{folder / name}.toml: {triangles} triangles")


main()
