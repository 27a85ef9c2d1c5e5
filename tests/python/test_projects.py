"""Projects in Python by `masseter new controller`."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import masseter

EXAMPLES = Path(__file__).parents[2] / "examples"
#: What a shell, a URL, TOML and Python read in a path.
FOLDERS = ["plain", "größe 2", "a $HOME b", "`id` c", 'quote"s \'\'\' and \\n', "a#b?c%20 d", "long " + "x" * 150]


def project(command: str, folder: Path, sdk: Path | None = None) -> Path:
    """The program of a new project, started by this Python."""
    words = [] if sdk is None else ["--sdk", str(sdk)]
    subprocess.run([command, "new", "controller", "--lang", "python", str(folder), *words], check=True, capture_output=True)
    python = folder / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    path = ":".join(filter(None, sys.path))
    python.write_text(f"#!/bin/sh\nPYTHONPATH='{path}' exec '{sys.executable}' \"$@\"\n")
    program = folder / "controller.py"
    for file in (python, program):
        file.chmod(0o755)
    return program


@pytest.mark.parametrize("name", FOLDERS)
def test_a_project_runs_in_any_folder(masseter_command: str, tmp_path: Path, name: str) -> None:
    program = project(masseter_command, tmp_path / name)
    compile(program.read_text(), str(program), "exec", dont_inherit=True)
    words = ["--duration", "0.2", "--clock", "lockstep", "--controller", str(program), "--quiet", "--out", str(tmp_path / "run")]
    done = subprocess.run([masseter_command, "run", *words], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0 and "Warning" not in done.stderr, done.stdout + done.stderr


@pytest.mark.parametrize("name", FOLDERS)
def test_the_package_of_a_project_has_a_url(masseter_command: str, tmp_path: Path, name: str) -> None:
    release = tmp_path / "release" / name
    for file in ("include/masseter.h", "lib/pkgconfig/masseter.pc", "masseter-0.1.0-cp311-abi3-linux_x86_64.whl"):
        (release / file).parent.mkdir(parents=True, exist_ok=True)
        (release / file).touch()
    folder = tmp_path / "project"
    project(masseter_command, folder, release)
    (required,) = tomllib.loads((folder / "pyproject.toml").read_text())["project"]["dependencies"]
    package, _, url = required.partition(" @ ")
    parts = urlsplit(url)
    assert package == "masseter" and url.isascii() and " " not in url and not parts.query + parts.fragment
    assert Path(unquote(parts.path)) == release / "masseter-0.1.0-cp311-abi3-linux_x86_64.whl"


def test_a_controller_of_the_drives_that_publishes_no_event_is_stopped_by_the_operator(masseter_command: str, tmp_path: Path) -> None:
    program = EXAMPLES / "controllers" / "drives" / "python" / "controller.py"
    assert "publish_event" not in program.read_text()
    text = f"import runpy, sys\nsys.path[:0] = {sys.path!r}\nrunpy.run_path({str(program)!r}, run_name='__main__')\n"
    (tmp_path / "program.py").write_text(text)
    scenario = shutil.copy(EXAMPLES / "suite" / "operator_stop.toml", tmp_path)
    words = [scenario, "--controller", f"{sys.executable} '{tmp_path / 'program.py'}'", "--clock", "lockstep", "--out", str(tmp_path / "run")]
    done = subprocess.run([masseter_command, "run", *words], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    events = masseter.load(tmp_path / "run").summary["figures"]["events"]
    stops = [event for event in events if event["cause"] == "stop_requested"]
    assert [stop["source"] for stop in stops] == ["controller"], events
