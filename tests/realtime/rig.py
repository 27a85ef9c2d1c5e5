"""Common to the scripts here: the processes of a rig, and what it leaves. Only the Python standard library is used."""

import os
import subprocess
from pathlib import Path


def start(masseter, run, clock, *more, runtime=None):
    """A rig without a terminal. Its locks and sockets are in the folder `runtime`, if given."""
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(runtime)} if runtime else None
    words = [masseter, "run", "--clock", clock, "--quiet", "--out", run, *more]
    return subprocess.Popen(
        words, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


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


def shared_memory_of(supervisor):
    """A rig's files in shared memory."""
    return [name for name in os.listdir("/dev/shm") if name.startswith(f"masseter_{os.getuid()}_{supervisor}-")]
