"""Two projects of others, made here, that have the installed package and nothing else of this repository.

A third, in Rust, is made by .ci/steps/88-packages of the packed crates.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).parent / "program.py"
#: What each project has beside its program and its tests.
COMMON = {
    "pyproject.toml": """
[project]
name = "bench"
version = "0.1.0"
dependencies = ["canopen"]
[dependency-groups]
test = ["masseter-drives[canopen]", "pytest"]
""",
    # The rig's own package, where it is installed, is not there for the project. A busy machine answers late.
    "conftest.py": """
import sys
from canopen.sdo.client import SdoClient

sys.modules["masseter"] = None
SdoClient.RESPONSE_TIMEOUT = 10.0
""",
}
SIX_AXES = {
    "test_six_axes.py": """
import pytest
from program import DriveFault, enable, move


def test_six_axes_boot_move_and_report_a_fault(drives):
    bus = drives(nodes=range(1, 7), profile="epos4")
    network = bus.network()
    for node in network.values():
        enable(node)
    for node in network.values():
        assert abs(move(node, 2000) - 2000) < 20
    bus.drive(4).begin("fault")
    with pytest.raises(DriveFault, match="node 4"):
        move(network[4], -2000)
"""
}
#: A program that opens the bus of its environment, which is a real one in production.
OWN_BUS = {
    "machine.py": """
import can
import canopen
from program import enable, move, reset


def boot_and_move(sheet):
    with canopen.Network(can.Bus()).connect() as network:
        node = network.add_node(3, sheet)
        reset(node)
        enable(node)
        return move(node, 2000)
""",
    "test_machine.py": """
import can
import pytest
from machine import boot_and_move
from masseter_drives import Drives


@pytest.fixture
def bus(monkeypatch):
    monkeypatch.setenv("CAN_INTERFACE", "virtual")
    monkeypatch.setenv("CAN_CHANNEL", "line")
    with can.Bus() as wire, Drives(nodes=[3], profile="n5") as bus:
        bus.serve(wire)
        yield bus


def test_the_machine_moves_on_the_bus_of_its_environment(bus, tmp_path):
    sheet = tmp_path / "drive.eds"
    sheet.write_text(bus.drive(3).eds)
    assert abs(boot_and_move(str(sheet)) - 2000) < 20
    assert bus.drive(3).state == "operation_enabled"
""",
}


@pytest.mark.parametrize("files", [SIX_AXES, OWN_BUS], ids=["six_axes", "own_bus"])
def test_a_project_with_the_package_alone_passes(files: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(PROGRAM, tmp_path)
    for name, text in {**COMMON, **files}.items():
        (tmp_path / name).write_text(text.lstrip())
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--durations=0", "--durations-min=0"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 0 and "1 passed" in ended.stdout, ended.stdout + ended.stderr
    with capsys.disabled():
        print("", *re.findall(r"[\d.]+s call .*", ended.stdout))
