"""Reads the workflow that `masseter init` lays down, with a real parser, and runs its step in a shell.

Fails when the file is no YAML, when a step is neither an action nor a script, when a script fails, or when a file is
missing that the workflow keeps.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import yaml

masseter = Path(sys.argv[1]).resolve()
environment = os.environ | {"PATH": f"{masseter.parent}:{os.environ['PATH']}"}

with tempfile.TemporaryDirectory() as place:
    folder = Path(place) / "rig"
    subprocess.run([masseter, "init", folder], check=True, stdout=subprocess.DEVNULL)
    workflow = yaml.safe_load((folder / ".github/workflows/masseter.yml").read_text())
    # YAML 1.1 reads the key `on` as true.
    assert set(workflow[True]) == {"push", "pull_request"}, workflow
    (job,) = workflow["jobs"].values()
    assert all(("uses" in step) != ("run" in step) for step in job["steps"]), job
    scripts = [step["run"] for step in job["steps"] if step.get("run", "").startswith("masseter ")]
    for script in scripts:
        subprocess.run(["bash", "-e", "-c", script], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    (kept,) = [step["with"]["path"].split() for step in job["steps"] if "upload-artifact" in step.get("uses", "")]
    assert scripts and kept and all((folder / name).is_file() for name in kept), (scripts, kept)
print(f"the workflow ran {'; '.join(scripts)} and kept {' '.join(kept)}")
