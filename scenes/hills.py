#!/usr/bin/env python3
"""Writes hills as an OBJ file with about as many triangles as asked for (ten million: 391 MB, half a minute):

    scenes/hills.py /tmp/hills.obj 10000000
    raycl render /tmp/hills.obj --plain --samples 1 --width 1920 --height 1080
"""
import math
import sys


def height(x, z):
    waves = [(0.5, 1.3, 0.7), (0.2, 3.1, -2.3), (0.05, 9.7, 8.1), (0.01, 41.0, 37.0)]
    return sum(size * math.sin(a * x + b * z) * math.cos(b * x - a * z) for size, a, b in waves)


def main():
    if len(sys.argv) != 3 or not sys.argv[2].isdecimal() or int(sys.argv[2]) < 2:
        sys.exit(__doc__)
    path, triangles = sys.argv[1], int(sys.argv[2])
    side = math.isqrt(triangles // 2)  # squares along each side, each of two triangles
    with open(path, "w", encoding="ascii") as file:
        for i in range(side + 1):
            x = 10 * i / side - 5
            row = ((x, 10 * j / side - 5) for j in range(side + 1))
            file.writelines(f"v {x:.5f} {height(x, z):.5f} {z:.5f}\n" for x, z in row)
        for i in range(side):
            first = i * (side + 1) + 1
            for a in range(first, first + side):
                c = a + side + 1
                file.write(f"f {a} {a + 1} {c}\nf {a + 1} {c + 1} {c}\n")
    print(f"{path}: {2 * side * side} triangles")


main()
