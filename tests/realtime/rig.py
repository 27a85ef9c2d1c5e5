"""Common to the scripts here: the processes of a rig, its end, and what it leaves. Only the Python standard library is
used."""

import os
import subprocess
import time
from pathlib import Path

# Longest time from a signal to the end of all processes of a rig, s.
END_S = 45.0
# Any number of cycles may be lost to the machine.
LENIENT = Path(__file__).parents[1] / "lenient.toml"
# The lock that all rigs of a user share stays.
TURN = ".turn"


class Again(Exception):
    """A trial shows nothing: the machine had ended the rig before, or the process was not there. Another is made."""


class Wrong(Exception):
    """What must not be."""


def require(is_so, what):
    if not is_so:
        raise Wrong(what)


def inside(runtime):
    """The environment of a rig whose locks and sockets are in the folder `runtime`."""
    return {**os.environ, "XDG_RUNTIME_DIR": str(runtime)}


def start(masseter, run, clock, *more, runtime):
    """A rig without a terminal."""
    words = [masseter, "run", *more, "--clock", clock, "--quiet", "--out", run]
    nowhere = subprocess.DEVNULL
    return subprocess.Popen(words, env=inside(runtime), stdin=nowhere, stdout=nowhere, stderr=nowhere)


def clean(masseter, runtime):
    """What a user does after the death of a supervisor."""
    subprocess.run([masseter, "clean"], env=inside(runtime), check=True, stdout=subprocess.DEVNULL)


def children_of(rig):
    """Process ids of the rig's parts by role."""
    found = {}
    try:
        children = Path(f"/proc/{rig.pid}/task/{rig.pid}/children").read_text().split()
    except FileNotFoundError:
        return found
    for child in children:
        try:
            arguments = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        except (FileNotFoundError, ProcessLookupError):
            continue
        if len(arguments) > 1:
            found[arguments[1].decode(errors="replace")] = int(child)
    return found


def lives(process):
    """Whether any of its threads does: the first may be dead while others still hold the process's files, and its lock."""
    proc = Path(f"/proc/{process}")
    try:
        threads = len(os.listdir(proc / "task"))
        return threads > 1 or (proc / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_for_end(rig, children, what):
    """Until the rig and the processes `children` have ended: the time that this took, s."""
    began = time.monotonic()
    while rig.poll() is None or any(lives(child) for child in children):
        require(time.monotonic() < began + END_S, f"{what}: a process still runs after {END_S:.0f} s")
        time.sleep(0.005)
    return time.monotonic() - began


def shared_memory_of(name):
    """Files in shared memory of a rig by its name, which begins with the id of its supervisor unless the user gives one."""
    return [file for file in os.listdir("/dev/shm") if file.startswith(f"masseter_{os.getuid()}_{name}")]


def left_of(name, runtime):
    """What a rig has left in shared memory and in the folder of its locks and sockets."""
    kept = [path for path in Path(runtime).rglob("*") if not path.is_dir() and path.name != TURN]
    return shared_memory_of(name) + kept
