"""Writes a results folder of 2,000 made-up points, some of whose texts try to become markup.

Usage: synthetic.py FOLDER
"""
import json
import random
import sys
from pathlib import Path

EVIL = "<script>window.injected=1</script>"
TRIANGLES = {"teapot": 1026, "gourd": 650, EVIL: 6, "terrain": 100_000, "still-life": 94}
SIZES = [1, 2, 4, 6, 8, 10, 12, 14, 16, 32]


def point(scene, device, number, side, base):
    """Returns a record. Most points are measured; a few fail, each in one of three ways."""
    record = {
        "key": f"{scene}-{device}-{number}-{side}", "timestamp": "2026-01-01T00:00:00Z", "scene": scene,
        "device": device, "name": f"strategy-{number}" if number else "naive", "preset": None if number else "naive",
        "strategy": f"traversal=exhaustive vectors=private width={number}", "local_size": [side, side],
        "image_size": [800, 500], "triangles": TRIANGLES[scene], "lights": 1, "samples_ms": [], "program_hash": "ab" * 8,
        "scene_notes": [f"normals are missing {EVIL}"] if scene == EVIL else [],
    }
    failure = {(32, 1): ("infeasible", "__local memory: 110592 B > 49152 B <img src=x onerror=window.injected=1>"),
               (14, 2): ("build-failed", "error: expected ';'\nand more"), (12, 0): ("wrong-image", "3 pixels are wrong")}
    if number and (side, number % 3) in failure:
        outcome, reason = failure[side, number % 3]
        return record | {"outcome": outcome, "reason": reason}
    middle = base * (1 + 0.3 * abs(side - 8) / 8)
    samples = [middle * random.gauss(1, 0.01) for _ in range(30)]
    ordered = sorted(samples)
    return record | {
        "outcome": "measured", "median_ms": ordered[15], "q1_ms": ordered[7], "q3_ms": ordered[22],
        "samples_ms": samples, "stop_reason": "precise",
        "rays_per_s": 4e8 / middle, "tests_per_s": 4e11 / middle,
    }


def main(folder):
    random.seed(1)
    folder.mkdir(parents=True, exist_ok=True)
    scenes = [("teapot", 100.0), ("gourd", 60.0), (EVIL, 9.0), ("terrain", 2000.0), ("still-life", 10.0)]
    devices = [("pthread-EPYC", 40.0), ("NVIDIA H200", 1.0)]
    records = [
        point(scene, device, number, side, base * slow * (1 + 0.3 * number))
        for scene, base in scenes for device, slow in devices for number in range(20) for side in SIZES
    ]
    (folder / "records.jsonl").write_text("".join(json.dumps(record) + "\n" for record in records))
    config = f'question = "Is {EVIL} text?"\nexpectation = "</style></script>{EVIL}"\n'
    environment = {"raycl_version": "0", "command_line": ["raycl", "run", EVIL], "config": config,
                   "git_revision": "0123456789ab", "host": {"clocks": {"governor": EVIL, "now_mhz": [2400, 3600], "max_mhz": None}},
                   "sources": [{"what": "scene", "path": EVIL, "hash": "cd" * 32, "git": "0123456789ab, changed since"}],
                   "devices": [{"device": "NVIDIA H200", "compute_capability": "9.0"}]}
    (folder / "environment.json").write_text(json.dumps(environment))


main(Path(sys.argv[1]))
