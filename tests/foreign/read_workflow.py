"""Reads the workflow that `masseter init` lays down, with a real parser, and runs its scripts in a shell.

Fails when the file is no YAML, or when a step is neither an action nor a script. Fails when a script fails, or when a file that
the workflow keeps is missing. The step that builds must fail before its variables are entered, with a message that
names the empty one and the file; once they are entered it must give them to cargo.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import yaml

WORKFLOW = ".github/workflows/masseter.yml"
ENTERED = {"MASSETER_GIT": "https://example.org/rig with a blank", "MASSETER_COMMIT": "0123abc"}
# Stands in for cargo: prints its arguments, one a line.
CARGO = "#!/bin/sh\nprintf '%s\\n' \"$@\"\n"

masseter = Path(sys.argv[1]).resolve()


def run(script, folder, programs, **variables):
    """Runs a script as GitHub does."""
    environment = os.environ | {"PATH": f"{programs}:{os.environ['PATH']}"} | variables
    return subprocess.run(["bash", "-e", "-c", script], cwd=folder, env=environment, capture_output=True, text=True)


with tempfile.TemporaryDirectory() as place:
    folder, programs = Path(place) / "rig", Path(place) / "programs"
    subprocess.run([masseter, "init", folder], check=True, stdout=subprocess.DEVNULL)
    workflow = yaml.safe_load((folder / WORKFLOW).read_text())
    # YAML 1.1 reads the key `on` as true.
    assert set(workflow[True]) == {"push", "pull_request"}, workflow
    (job,) = workflow["jobs"].values()
    assert all(("uses" in step) != ("run" in step) for step in job["steps"]), job

    programs.mkdir()
    (programs / "cargo").write_text(CARGO)
    (programs / "cargo").chmod(0o755)
    (build,) = [step["run"] for step in job["steps"] if step.get("name") == "Build"]
    empty = workflow["env"]
    assert set(empty) == set(ENTERED) and not any(empty.values()), empty
    for missing in ENTERED:
        # The first one is missing in the file as laid down; the second once the first is entered.
        built = run(build, folder, programs, **(ENTERED | {missing: empty[missing]}))
        assert built.returncode not in (0, 126) and not built.stdout, built
        (message,) = built.stderr.splitlines()
        assert f"{missing}: is empty" in message and WORKFLOW in message and "enter" in message, built
    built = run(build, folder, programs, **empty)
    assert built.returncode != 0 and "MASSETER_GIT: is empty" in built.stderr and not built.stdout, built
    built = run(build, folder, programs, **ENTERED)
    git, commit = ENTERED["MASSETER_GIT"], ENTERED["MASSETER_COMMIT"]
    expected = ["install", "--locked", "masseter", "--git", git, "--rev", commit]
    assert built.returncode == 0 and built.stdout.splitlines() == expected, built

    scripts = [step["run"] for step in job["steps"] if step.get("run", "").startswith("masseter ")]
    for script in scripts:
        played = run(script, folder, masseter.parent)
        assert played.returncode == 0, played
    (kept,) = [step["with"]["path"].split() for step in job["steps"] if "upload-artifact" in step.get("uses", "")]
    # Runs that passed leave no folder.
    files = [name for name in kept if name != "failed"]
    assert scripts and files and all((folder / name).is_file() for name in files), (scripts, kept)
print(f"the workflow asked for its variables, ran {'; '.join(scripts)} and kept {' '.join(kept)}")
