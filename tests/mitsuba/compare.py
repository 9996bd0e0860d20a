"""Renders courtyard.toml, lamps.toml and studio.toml with raycl and with Mitsuba 3, and prints how much the pictures differ.

Usage: compare.py RAYCL FOLDER [SAMPLES, 256]. Scenes, meshes and pictures go to FOLDER.
"""
import math
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
Transform = mi.ScalarTransform4f

import models

SIZE = (640, 400)
# The least signal-to-noise ratios, in dB, of a picture and of the means of its blocks of pixels. The means have little
# noise, so their ratio is below its limit even if a light is too bright by only one hundredth.
LEAST, LEAST_OF_BLOCKS = 30, 50
# The side of a block, in pixels.
BLOCK = 8
# Samples of a pixel that Mitsuba casts at once.
BATCH = 16
# Mitsuba's masks have this many times as many texels as raycl's, in each direction.
FINER = 16


def main():
    raycl, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    samples = int(sys.argv[3]) if len(sys.argv) > 3 else 256
    folder.mkdir(parents=True, exist_ok=True)
    models.make(folder)
    print(f"Mitsuba {mi.__version__}, {subprocess.check_output([raycl, '--version'], text=True).strip()}, "
          f"{SIZE[0]}x{SIZE[1]}, {samples} samples per pixel; PSNR in linear light, peak 1")
    failed = []
    for name in ("courtyard", "lamps", "studio"):
        file = folder / f"{name}.toml"
        shutil.copy(Path(__file__).parent / file.name, file)
        halves = [by_mitsuba(file, samples // 2, seed) for seed in (0, 1)]
        theirs = (halves[0] + halves[1]) / 2
        for changes in ([], ["mip_levels=true"]):
            own = by_raycl(raycl, file, samples, *changes)
            found = likeness(own, theirs), likeness(blocks(own), blocks(theirs))
            print(f"{', '.join([name, *changes])}: {found[0]:.1f} dB, means of blocks {found[1]:.1f} dB; "
                  f"mean radiance {own.mean():.5f} and {theirs.mean():.5f}")
            failed += [name] if found[0] < LEAST or found[1] < LEAST_OF_BLOCKS else []
            show(folder, name, own, theirs)
        # The difference of two halves of the samples has twice the standard error of the mean of all samples,
        # so both halves are divided by 2.
        halves = [half / 2 for half in halves]
        print(f"{name}: noise of Mitsuba's picture alone {likeness(*halves):.1f} dB, "
              f"means of blocks {likeness(*map(blocks, halves)):.1f} dB")
    sys.exit(f"less than {LEAST} or {LEAST_OF_BLOCKS} dB: {', '.join(failed)}" if failed else 0)


def show(folder, name, own, theirs):
    """Writes both pictures, and ten times their difference on grey."""
    for kind, values in (("raycl", own), ("mitsuba", theirs)):
        models.save(folder / f"{name}-{kind}.png", *np.moveaxis(np.clip(values, 0, 1) ** (1 / 2.2), -1, 0))
    models.save(folder / f"{name}-difference.png", *np.moveaxis(0.5 + 10 * (own - theirs), -1, 0))


def blocks(picture):
    """Returns the means of blocks of pixels."""
    width, height = SIZE
    return picture.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean(axis=(1, 3))


def likeness(one, other):
    """Returns the ratio of signal to noise in dB, for a peak of 1."""
    return -10 * math.log10(np.mean((one - other) ** 2))


def by_raycl(raycl, file, samples, *changes):
    picture = file.with_suffix(".exr")
    changes = [word for change in changes for word in ("--set", change)]
    size = ["--width", str(SIZE[0]), "--height", str(SIZE[1])]
    subprocess.run([raycl, "render", file, "-o", picture, "--samples", str(samples), *size, *changes, "--quiet",
                    "--force"], check=True)
    return np.array(mi.Bitmap(str(picture)), dtype=np.float64)[..., :3]


def by_mitsuba(file, samples, seed):
    """Returns the sum of a picture with only the lamps and one with only the sky: Mitsuba's lamps would occlude the sky."""
    scene = tomllib.loads(file.read_text())
    lamps = {f"light{i}": lamp(light) for i, light in enumerate(scene.get("light", []))}
    seen = "picture" in scene.get("sky", {})
    light = 0
    if "sky" in scene:
        light = cast(scene, file.parent, {"sky": sky(scene["sky"], file.parent)}, not seen, samples, 2 * seed)
    if lamps:
        of_lamps = cast(scene, file.parent, lamps, True, samples, 2 * seed + 1)
        # The last channel, the share of samples that hit something, counts once.
        light = light + of_lamps * [1, 1, 1, "sky" not in scene]
    # Rays that hit nothing see the background.
    return light[..., :3] + (0 if seen else (1 - light[..., 3:]) * scene["background"])


def lamp(light):
    """A ball of uniform radiance L has the power 4 pi R^2 pi L, and the front of a surface pi L times its area."""
    if "edges" in light:
        first, second = np.array(light["edges"], dtype=float)
        normal = np.cross(first, second)
        is_disc = light.get("shape") == "disc"
        radiance = np.array(light["power"]) / (math.pi * np.linalg.norm(normal) * (math.pi / 4 if is_disc else 1))
        # Mitsuba's rectangle and disc reach from -1 to 1 along x and y, and shine towards z.
        matrix = np.eye(4)
        matrix[:3] = np.stack([first / 2, second / 2, normal / np.linalg.norm(normal), light["position"]], axis=-1)
        return {"type": "disk" if is_disc else "rectangle", "to_world": Transform(matrix),
                "emitter": {"type": "area", "radiance": rgb(radiance)}}
    radiance = np.array(light["power"]) / (4 * math.pi**2 * light["radius"] ** 2)
    return {"type": "sphere", "center": light["position"], "radius": light["radius"],
            "emitter": {"type": "area", "radiance": rgb(radiance)}}


def sky(sky, folder):
    if "picture" not in sky:
        return {"type": "constant", "radiance": rgb(sky["zenith"])}
    # The middle of the sky's picture is in the direction +z in Mitsuba, and in the direction -z in raycl.
    turn = Transform().rotate([0, 1, 0], 180 + sky["turn_degrees"])
    return {"type": "envmap", "bitmap": rows_from_pole_to_pole(folder / sky["picture"]),
            "scale": sky["strength"], "to_world": turn}


def rows_from_pole_to_pole(path, finer=4):
    """Returns a finer picture for Mitsuba from a sky's picture for raycl. In Mitsuba, the centres of the first and last
    rows of texels lie at the zenith and the nadir; in raycl, half a texel away from them. The texels of the finer
    picture are mixed from the four nearest texels, so that both pictures have the same values in every direction."""
    texels = np.array(mi.Bitmap(str(path)), dtype=np.float32)[..., :3]
    height, width = texels.shape[:2]
    x = (np.arange(finer * width) + 0.5) / finer - 0.5
    y = np.linspace(0, height, finer * height + 1) - 0.5
    return mi.Bitmap(mixed(texels, x, y, lambda row: np.clip(row, 0, height - 1)))


def mixed(texels, x, y, within):
    """Mixes the four nearest texels at all rows `y` and columns `x`, in texels. The first column follows the last one."""
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    part = (x - left)[None, :, None]
    rows = [texels[within(row)] for row in (top, top + 1)]
    upper, lower = (row[:, left % row.shape[1]] * (1 - part) + row[:, (left + 1) % row.shape[1]] * part for row in rows)
    part = (y - top)[:, None, None]
    return (upper * (1 - part) + lower * part).astype(np.float32)


def rgb(values):
    return {"type": "rgb", "value": [float(value) for value in values]}


def cast(scene, folder, lights, hidden, samples, seed):
    """Returns radiance and the share of samples that hit something. `volpath` lets shadow rays through holes, and with
    a depth of 2 there is direct light alone."""
    camera = scene["camera"]
    axis = "x" if "fov_x_degrees" in camera else "y"
    sensor = {"type": "perspective", "fov": camera[f"fov_{axis}_degrees"], "fov_axis": axis, "near_clip": 1e-3,
              "to_world": Transform().look_at(camera["position"], camera["look_at"], [0, 1, 0]),
              "film": {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1]}}
    objects = {f"object{i}": shape(thing, folder) for i, thing in enumerate(scene["object"])}
    world = mi.load_dict({"type": "scene", "sensor": sensor, **objects, **lights})
    integrator = mi.load_dict({"type": "volpath", "max_depth": 2, "rr_depth": 99, "hide_emitters": hidden})
    total, chance = np.zeros((SIZE[1] * SIZE[0], 4)), np.random.default_rng(seed)
    pixels = np.repeat(np.stack(np.meshgrid(*map(np.arange, SIZE)), axis=-1).reshape(-1, 2), BATCH, axis=0)
    for batch in range(samples // BATCH):
        at = (pixels + 0.5 + filtered(chance.random(pixels.shape))) / SIZE
        at = mi.Point2f(np.ascontiguousarray(at.T, dtype=np.float32))
        sampler = mi.load_dict({"type": "independent"})
        # The seed is opaque: if it were a constant, the code would be compiled again for each batch.
        sampler.seed(dr.opaque(mi.UInt32, 1 + batch + 100_000 * seed), len(pixels))
        ray, _ = world.sensors()[0].sample_ray(0, 0, at, mi.Point2f(0))
        light, hit, _ = integrator.sample(world, sampler, mi.RayDifferential3f(ray))
        channels = [*light, dr.select(hit, mi.Float(1), 0)]
        dr.eval(channels)
        found = np.stack([np.array(channel) for channel in channels], axis=-1)
        total += found.reshape(-1, BATCH, 4).sum(axis=1)
    return (total / samples).reshape(SIZE[1], SIZE[0], 4)


def filtered(chance):
    """Returns offsets from a pixel's centre, drawn from raycl's filter: Blackman-Harris, 1.5 pixels wide."""
    at = np.linspace(-0.75, 0.75, 2001)
    weights = sum(a * np.cos(2 * math.pi * k * at / 1.5) for k, a in enumerate((0.35875, 0.48829, 0.14128, 0.01168)))
    below = np.concatenate([[0], np.cumsum((weights[1:] + weights[:-1]) / 2)])
    return np.interp(chance, below / below[-1], at)


def shape(thing, folder):
    turns = list(zip(np.eye(3), thing.get("rotation", [0, 0, 0])))
    transform = Transform().translate(thing.get("translation", [0, 0, 0]))
    for axis, degrees in reversed(turns):
        transform = transform @ Transform().rotate(axis, degrees)
    transform = transform @ Transform().scale(thing.get("scale", 1))
    path = folder / thing["mesh"]
    return {"type": "obj", "filename": str(path), "to_world": transform, "bsdf": surface(path.with_suffix(".mtl"))}


def surface(path):
    """The Lambertian surface that an MTL file of one material describes, lit on both sides."""
    words = {line.split()[0]: line.split()[1:] for line in path.read_text().splitlines()}
    factor = [float(value) for value in words.get("Kd", [1, 1, 1])]
    colour = rgb(factor)
    if "map_Kd" in words:
        texels = mi.Bitmap(str(path.parent / words["map_Kd"][-1])).convert(
            mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
        wrap = "clamp" if "-clamp" in words["map_Kd"] else "repeat"
        texels = mi.Bitmap(np.array(texels) * np.array(factor, dtype=np.float32))
        colour = {"type": "bitmap", "bitmap": texels, "raw": True, "wrap_mode": wrap}
    bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": colour}}
    if "map_d" not in words:
        return bsdf
    return {"type": "mask", "opacity": opacity(path.parent / words["map_d"][-1]), "bsdf": bsdf}


def opacity(path):
    """raycl's holes begin where the mean of the four nearest texels is less than one half; Mitsuba has no such rule, and
    gets a finer picture that is 0 or 1."""
    texels = np.array(mi.Bitmap(str(path)), dtype=np.float32)[..., -1:] / 255
    height, width = texels.shape[:2]
    x, y = ((np.arange(FINER * size) + 0.5) / FINER - 0.5 for size in (width, height))
    finer = mixed(texels, x, y, lambda row: row % height)
    return {"type": "bitmap", "bitmap": mi.Bitmap((finer >= 0.5).astype(np.float32)), "raw": True,
            "filter_type": "nearest"}


if __name__ == "__main__":
    main()
