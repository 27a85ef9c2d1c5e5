"""Projects of `masseter new controller`: built, run, and equal in every language.

    controllers.py MASSETER TARGET
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from projects import make

LANGUAGES = ["rust", "c", "cpp", "python"]
# The law of a program, as gdb finds its function.
LAWS = {"c": "^command$", "rust": "my_controller.*command"}


def run(masseter: str, program: str, folder: Path, clock: str, *more: str) -> dict:
    arguments = [*more, "--quiet", "--duration", "2", "--clock", clock, "--format", "json", "--controller", program]
    ended = subprocess.run([masseter, "run", *arguments], cwd=folder, capture_output=True, text=True)
    figures = json.loads(ended.stdout) if ended.stdout else {"verdict": {}}
    # The machine may take cycles from a run in real time, which is then not judged. An interpreter may compute for too long.
    verdict = figures["verdict"]
    failed = [check["name"] for check in verdict.get("checks", []) if check["result"] == "failed"]
    faults = [event["cause"] for event in figures.get("figures", {}).get("events", []) if event["kind"] == "fault"]
    # Where that is longer than the master waits for a command, the rig stops safely.
    is_stopped = ended.returncode == 5 and verdict["timing"]["word"] in ("missed", "disturbed") and faults[:1] == ["command_lost"]
    is_late = clock == "rt" and (ended.returncode == 3 or failed == ["timing"] or is_stopped)
    assert ended.returncode == 0 or is_late, f"{program}, {clock}: {ended.returncode}\n{ended.stdout}{ended.stderr}"
    return figures


def stop_in_the_law(masseter: str, program: str, law: str, folder: Path) -> None:
    """The program in gdb, with a breakpoint in its law: it stops there, goes on, and passes."""
    words = [masseter, "run", "--controller", "external", "--name", "gdb", "--clock", "lockstep", "--patience", "none", "--duration", "1"]
    rig = subprocess.Popen([*words, "--quiet"], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while "waiting for a controller" not in (line := rig.stderr.readline()):
        assert line, "the rig ended"
    orders = [f"rbreak {law}", "run", "backtrace 1", "delete", "continue"]
    debugger = ["gdb", "-batch", *(word for order in orders for word in ("-ex", order)), program]
    said = subprocess.run(debugger, env={**os.environ, "MASSETER_RIG": "gdb"}, capture_output=True, text=True, timeout=120).stdout
    output, _ = rig.communicate(timeout=60)
    assert re.search(f"hit Breakpoint \\d+, .*{law.strip('^$').rpartition(':')[2]}", said), said
    assert output.startswith("PASS"), output


# A fault of a drive halfway, which the run expects to end in a safe stop.
FAULT = """
[[faults]]
kind = "drive_fault"
axis = "l2"
at_s = 0.5

[[require]]
name = "stops"
when = "fault.drive_fault"
then = "controller.state == safe_stop"
within = "50 ms"

[expect]
verdict = "safe_stop"
"""


def follow_the_drives(masseter: str, folder: Path, target: Path) -> None:
    """Controllers of the drives play the same motions and stop on a fault, in every language alike."""
    (folder / "fault.toml").write_text(FAULT)
    digests: dict[str, set[str]] = {}
    for language in LANGUAGES:
        program = make(masseter, language, "drives", folder, target)
        for clock in ["lockstep", "virtual"]:
            for scenario in [[], ["fault.toml"], ["--set", "motion.kind=opening"]]:
                figures = run(masseter, program, folder, clock, *scenario)["figures"]
                digests.setdefault(" ".join(scenario), set()).add(figures["digest"])
        print(f"{language}: a controller of the drives")
    assert all(len(found) == 1 for found in digests.values()), digests
    assert len(set.union(*digests.values())) == len(digests), digests


# A requirement on what the controllers declare themselves.
REQUIRED = """
[[require]]
name = "trim"
signal = "signal.trim"
during = "running"
max = "1 mm"

[[require]]
name = "gain"
signal = "parameter.gain"
min = 20
max = 20
"""


def main(masseter: str, target: str) -> None:
    masseter = str(Path(masseter).resolve())
    # Users have folders with spaces and umlauts.
    with tempfile.TemporaryDirectory(prefix="größe 2 ") as name:
        folder = Path(name)
        digests, stiff = {}, {}
        (folder / "required.toml").write_text(REQUIRED)
        for language in LANGUAGES:
            program = make(masseter, language, "pose", folder, Path(target))
            digests[language] = [
                run(masseter, program, folder, clock)["figures"]["digest"] for clock in ["lockstep", "virtual", "lockstep"]
            ]
            run(masseter, program, folder, "rt")
            summary = run(masseter, program, folder, "lockstep", "required.toml", "--set", "gain=20")
            stiff[language] = summary["figures"]
            checks = {check["name"]: check for check in summary["verdict"]["checks"]}
            assert checks["trim"]["result"] == checks["gain"]["result"] == "passed", checks
            assert 0.0 < checks["trim"]["margin"] < 1.0, checks["trim"]
            if law := LAWS.get(language):
                stop_in_the_law(masseter, program, law, folder)
            print(f"{language}: digest {digests[language][0]}, and a run in real time")
        found = {digest for of_language in digests.values() for digest in of_language}
        assert len(found) == 1, digests
        # Another gain moves the robot otherwise, in every language alike, and the signal is the same number.
        assert len({figures["digest"] for figures in stiff.values()} - found) == 1, stiff
        trims = {figures["signals"][0]["max"] for figures in stiff.values()}
        assert len(trims) == 1 and 0.001 < trims.pop() < 1.0, stiff
        follow_the_drives(masseter, folder, Path(target))
        own = run(masseter, "motion", folder, "lockstep")["figures"]["digest"]
        assert own not in found, "the law of the projects is not the rig's own"


main(*sys.argv[1:])
