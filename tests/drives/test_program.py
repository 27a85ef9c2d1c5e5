"""A user's program on python-canopen, tested with emulated drives; the example of the package's README."""

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import canopen
import pytest
from program import DriveFault, enable, move, reset

from masseter_drives import Drives

HERE = Path(__file__).parent
README = HERE.parents[1] / "rig/bindings/drives/README.md"

Maker = Callable[..., Drives]


def test_six_drives_boot_move_and_fail(drives: Maker) -> None:
    bus = drives(nodes=range(1, 7), profile="epos4")
    network = bus.network()
    for node in network.values():
        enable(node)
    for node in network.values():
        assert abs(move(node, 2000) - 2000) < 20
    bus.drive(4).begin("fault")
    with pytest.raises(DriveFault, match="node 4"):
        move(network[4], -2000)
    assert {bus.drive(node).state for node in (1, 2, 3, 5, 6)} == {"operation_enabled"}


def test_a_motor_without_force_lets_its_load_fall(drives: Maker) -> None:
    bus = drives(nodes=[3])
    node = bus.network()[3]
    enable(node)
    drive = bus.drive(3)
    drive.load_n = 10.0
    drive.begin("torque_loss", 1.0)
    with pytest.raises(DriveFault, match="8400h"):
        move(node, 20_000)
    assert drive.has_struck("torque_loss")
    assert drive.position_m < 0.15


def test_a_program_that_connects_by_itself_finds_the_drives_by_their_channel(drives: Maker) -> None:
    bus = drives("bench", nodes=[9])
    with canopen.Network() as network:
        network.connect(interface="masseter", channel="bench", bitrate=1_000_000)
        network.scanner.search()
        node = network.add_node(9)
        reset(node)
        assert bus.drive(9).state == "switch_on_disabled"
        assert network.scanner.nodes == [9]


def test_a_program_moves_a_drive_in_simulated_time(drives: Maker) -> None:
    bus = drives(nodes=[1], clock="simulated")
    node = bus.network()[1]
    enable(node)
    assert abs(move(node, 2000) - 2000) < 20


def test_the_readme_s_ten_lines_pass(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    shutil.copy(HERE / "program.py", tmp_path)
    for number, block in enumerate(blocks):
        name = f"test_{number}.py" if "def test" in block else f"example_{number}.py"
        (tmp_path / name).write_text(block)
        command = ["-m", "pytest", "-q", "-p", "no:cacheprovider", name] if "def test" in block else [name]
        ended = subprocess.run([sys.executable, *command], cwd=tmp_path, capture_output=True, text=True)
        assert ended.returncode == 0, ended.stdout + ended.stderr
    assert len(blocks) == 3
