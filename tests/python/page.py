"""Runs each block of Python code of a page in a separate process, and stops at the first block that fails."""

import os
import re
import shutil
import subprocess
import sys

page, folder = sys.argv[1:]
blocks = re.findall(r"^```python\n(.*?)^```$", open(page).read(), re.DOTALL | re.MULTILINE)
assert len(blocks) >= 8, f"{len(blocks)} blocks"
# Blocks write their files to the folder in which they run, so this folder has a copy of the files that they read.
cwd = f"{folder}/cwd"
shutil.rmtree(cwd, ignore_errors=True)
for part in ("results", "schemas"):
    shutil.copytree(f"docs/{part}", f"{cwd}/docs/{part}")
# The blocks must also be able to read an empty file: a run that was interrupted before its first record leaves one.
os.makedirs(f"{cwd}/docs/results/interrupted/run")
open(f"{cwd}/docs/results/interrupted/run/records.jsonl", "w").close()
for number, block in enumerate(blocks, 1):
    done = subprocess.run([sys.executable, "-c", block], cwd=cwd, capture_output=True, text=True)
    if done.returncode != 0 or not done.stdout.strip():
        sys.exit(f"block {number} of {page}:\n{block}\n{done.stdout}{done.stderr}")
    print(f"block {number}: {len(done.stdout.splitlines())} lines printed")
