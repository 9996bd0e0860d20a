"""Runs each block of Python code of a page in a separate process, and stops at the first block that fails."""

import os
import re
import subprocess
import sys

page, folder = sys.argv[1:]
blocks = re.findall(r"^```python\n(.*?)^```$", open(page).read(), re.DOTALL | re.MULTILINE)
assert len(blocks) >= 8, f"{len(blocks)} blocks"
# Blocks run in a folder that can be deleted, so that they write their files there. They read the repository's docs/.
os.makedirs(f"{folder}/cwd", exist_ok=True)
link = f"{folder}/cwd/docs"
if not os.path.islink(link):
    os.symlink(os.path.abspath("docs"), link)
for number, block in enumerate(blocks, 1):
    done = subprocess.run([sys.executable, "-c", block], cwd=f"{folder}/cwd", capture_output=True, text=True)
    if done.returncode != 0 or not done.stdout.strip():
        sys.exit(f"block {number} of {page}:\n{block}\n{done.stdout}{done.stderr}")
    print(f"block {number}: {len(done.stdout.splitlines())} lines printed")
