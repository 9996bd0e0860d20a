"""Reads raycl's exports with the tools they are for: the T4 schema, and Kernel Tuner from PyPI.

Usage: check.py FOLDER, a results folder with exports/. Needs the packages kernel_tuner and jsonschema.
"""
import json
import shutil
import sys
import tempfile
from pathlib import Path

import jsonschema
from kernel_tuner import util
from kernel_tuner.file_utils import output_file_schema


def check_t4(path):
    version, schema = output_file_schema("results")
    document = json.loads(path.read_text())
    assert document["schema_version"] == version
    jsonschema.validate(document, schema)
    assert document["results"], "no results"
    return len(document["results"])


def check_cache(path):
    """Opens a cache as Kernel Tuner does, and lets Kernel Tuner find the best configuration in it."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        shutil.copy(path, copy)
        cache = util.read_cache(str(copy), open_cache=False)
    names = cache["tune_params_keys"]
    valid = {}
    for key, entry in cache["cache"].items():
        assert key == ",".join(str(entry[name]) for name in names), key
        assert all(entry[name] in cache["tune_params"][name] for name in names), key
        if isinstance(entry.get("__error__"), util.ErrorConfig):
            continue
        assert isinstance(entry["time"], float) and entry["times"], key
        valid[key] = entry
    if valid:
        best = util.get_best_config(list(valid.values()), "time")
        assert best["time"] == min(entry["time"] for entry in valid.values())
    return len(cache["cache"]), len(valid)


def simulate(path):
    """Lets Kernel Tuner simulate tuning from a file, without a device, and compares its best time with the file's."""
    from kernel_tuner import tune_cache

    cache = util.read_cache(str(path), open_cache=False)
    times = [entry["time"] for entry in cache["cache"].values() if "__error__" not in entry]
    if not times:
        return 0
    results, _ = tune_cache(str(path), strategy="brute_force", verbose=False, quiet=True)
    found = [result["time"] for result in results if isinstance(result["time"], float)]
    assert min(found) == min(times), (min(found), min(times))
    return len(found)


exports = Path(sys.argv[1]) / "exports"
print(f"T4: {check_t4(exports / 't4-results.json')} results agree with the schema")
caches = sorted(exports.glob("kernel-tuner-*.json"))
assert caches, "no Kernel Tuner cache"
for path in caches:
    points, valid = check_cache(path)
    print(f"Kernel Tuner: {points} points, {valid} of them timed: {path.name}")
try:
    simulated = sum(simulate(path) for path in caches)
    print(f"Kernel Tuner simulates tuning on all {len(caches)} files, {simulated} configurations, and finds the same best in each")
except ImportError as error:
    sys.exit(f"kernel_tuner cannot simulate: {error}")
