"""Every service of the drives by python-canopen, a master of others: a test for each row of the table in docs/can.md."""

import queue
import struct
import time
from collections.abc import Callable
from typing import Any

import canopen
import pytest
from program import DriveFault, enable, move, wait_for

from masseter_drives import Drives, FrameError

NODE = 4
#: The node whose heartbeat the drive supervises.
MASTER = 127


@pytest.fixture
def bus(drives: Callable[..., Drives]) -> Drives:
    return drives(nodes=[NODE], master_timeout_ms=0)


@pytest.fixture
def node(bus: Drives) -> Any:
    return bus.network()[NODE]


def listen(node: Any, number: int) -> Callable[[Callable[[bytes], bool]], bytes]:
    """What waits for a frame with this identifier from now on whose data satisfy a condition."""
    frames: queue.Queue[bytes] = queue.Queue()
    node.network.subscribe(number, lambda _, data, __: frames.put(bytes(data)))

    def until(holds: Callable[[bytes], bool]) -> bytes:
        while not holds(data := frames.get(timeout=10)):
            pass
        return data

    return until


def start(node: Any, mode: int) -> None:
    enable(node)
    node.sdo[0x6060].raw = mode
    wait_for(node, f"mode {mode}", lambda _: node.sdo[0x6061].raw == mode)


def wait_for_speed(node: Any, speed: int) -> None:
    wait_for(node, f"{speed} increments/s", lambda _: abs(node.sdo[0x606C].raw - speed) < 500)


def run(node: Any, speed: int) -> None:
    """Profile velocity."""
    start(node, 3)
    node.sdo[0x60FF].raw = speed
    wait_for_speed(node, speed)


def test_network_management_changes_the_state_that_heartbeats_show(node: Any) -> None:
    heartbeat = listen(node, 0x700 + NODE)
    for command, state in [("OPERATIONAL", 5), ("STOPPED", 4), ("PRE-OPERATIONAL", 127), ("RESET COMMUNICATION", 0), ("RESET", 0)]:
        node.nmt.state = command
        assert heartbeat(lambda data, state=state: data == bytes([state]))  # type: ignore[misc]


def test_a_drive_sends_heartbeats_and_misses_those_of_its_master(node: Any) -> None:
    node.sdo[0x1017].raw = 20
    heartbeat = listen(node, 0x700 + NODE)
    assert heartbeat(lambda data: data == b"\x7f") and heartbeat(lambda data: data == b"\x7f")
    node.sdo[0x1016][1].raw = MASTER << 16 | 50
    emergency = listen(node, 0x080 + NODE)
    node.network.send_message(0x700 + MASTER, b"\x05")
    assert emergency(lambda data: data[:2] == b"\x30\x81")


def test_a_fault_and_its_end_are_emergencies(bus: Drives, node: Any) -> None:
    enable(node)
    emergency = listen(node, 0x080 + NODE)
    bus.drive(NODE).begin("fault")
    code = int.from_bytes(emergency(lambda data: data[:2] != b"\0\0")[:2], "little")
    assert code == node.sdo[0x603F].raw == node.sdo[0x1003][1].raw & 0xFFFF
    bus.drive(NODE).end("fault")
    node.sdo[0x6040].raw = 0x80
    assert emergency(lambda data: data[:2] == b"\0\0")
    assert [entry.code for entry in node.emcy.log] == [code, 0]


def test_numbers_are_transferred_expedited_and_refusals_have_their_code(node: Any) -> None:
    for index, value in [(0x6060, 3), (0x605A, 5), (0x6081, 50_000), (0x60FF, -7)]:
        node.sdo[index].raw = value
        assert node.sdo[index].raw == value
    with pytest.raises(canopen.SdoAbortedError) as refusal:
        node.sdo.download(0x1000, 0, bytes(4))
    assert refusal.value.code == 0x06010002


def test_data_are_transferred_in_segments_both_ways(node: Any) -> None:
    assert node.sdo.upload(0x1008, 0) == b"Masseter emulated drive"
    data = bytes(place * 37 % 251 for place in range(100))
    node.sdo.download(0x2010, 0, data, force_segment=True)
    assert node.sdo.upload(0x2010, 0) == data


def test_data_are_transferred_in_blocks_both_ways(node: Any) -> None:
    data = bytes(place * 37 % 251 for place in range(1024))
    with node.sdo.open(0x2010, 0, "wb", size=len(data), block_transfer=True) as user_data:
        user_data.write(data)
    with node.sdo.open(0x2010, 0, "rb", block_transfer=True) as user_data:
        assert user_data.read() == data


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_each_pdo_is_mapped_and_exchanged_at_sync(node: Any, number: int) -> None:
    node.tpdo.read()
    node.rpdo.read()
    tpdo, rpdo = node.tpdo[number], node.rpdo[number]
    for pdo, objects, first in [(tpdo, (0x60FF, 0x6060), 0x180), (rpdo, (0x6060, 0x60FF), 0x200)]:
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.cob_id, pdo.trans_type, pdo.enabled = first + 0x100 * (number - 1) + NODE, 1, True
        pdo.save()
    node.nmt.state = "OPERATIONAL"
    answer = listen(node, tpdo.cob_id)
    rpdo[0].raw, rpdo[1].raw = 3, 1234
    rpdo.transmit()
    # The first SYNC takes the data; SYNC wins arbitration against data that wait.
    for _ in range(3):
        node.network.sync.transmit()
    assert answer(lambda data: data == struct.pack("<ib", 1234, 3))
    assert node.sdo[0x60FF].raw == 1234


def test_profile_position_moves_the_axis(node: Any) -> None:
    enable(node)
    assert abs(move(node, 2000) - 2000) < 20


def test_profile_velocity_is_reached_and_kept(node: Any) -> None:
    run(node, 5000)
    wait_for(node, "target reached", lambda word: bool(word & 1 << 10))
    run(node, -5000)


def torques(node: Any) -> Callable[[Callable[[bytes], bool]], bytes]:
    """Waits for the actual torque: every frame counts, however late it is read."""
    node.tpdo.read()
    tpdo = node.tpdo[2]
    tpdo.clear()
    tpdo.add_variable(0x6077)
    tpdo.cob_id, tpdo.trans_type, tpdo.event_timer, tpdo.enabled = 0x280 + NODE, 255, 2, True
    tpdo.save()
    node.nmt.state = "OPERATIONAL"
    return listen(node, tpdo.cob_id)


@pytest.mark.parametrize("mode", [4, 10], ids=["profile", "cyclic"])
def test_a_torque_is_given(node: Any, mode: int) -> None:
    start(node, mode)
    until = torques(node)
    node.sdo[0x6071].raw = 10
    node.network.sync.transmit()
    assert until(lambda data: struct.unpack("<h", data)[0] in range(9, 12))


def test_homing_makes_the_present_position_home(node: Any) -> None:
    start(node, 6)
    node.sdo[0x607C].raw = 0
    node.sdo[0x6098].raw = 37
    node.sdo[0x6040].raw = 0x1F
    wait_for(node, "home", lambda word: bool(word & 1 << 12))
    assert abs(node.sdo[0x6064].raw) < 20


def test_cyclic_positions_are_followed(node: Any) -> None:
    start(node, 8)
    target = node.sdo[0x6064].raw + 1000
    for position in range(target - 990, target + 1, 10):
        node.sdo[0x607A].raw = position
        node.network.sync.transmit()
    wait_for(node, "arrived", lambda _: abs(node.sdo[0x6064].raw - target) < 20)


def test_a_cyclic_velocity_is_followed(node: Any) -> None:
    start(node, 9)
    node.sdo[0x60FF].raw = 5000
    node.network.sync.transmit()
    wait_for_speed(node, 5000)


@pytest.mark.parametrize(("option", "mask", "state"), [(2, 0x4F, 0x40), (6, 0x6F, 0x07)])
def test_a_quick_stop_ends_as_605a_says(node: Any, option: int, mask: int, state: int) -> None:
    node.sdo[0x605A].raw = option
    run(node, 5000)
    node.sdo[0x6040].raw = 0x02
    wait_for(node, f"state {state:02X}h", lambda word: word & mask == state)
    wait_for_speed(node, 0)


@pytest.mark.parametrize("option", [1, 2])
def test_a_halt_stops_as_605d_says_and_its_end_resumes(node: Any, option: int) -> None:
    node.sdo[0x605D].raw = option
    run(node, 5000)
    node.sdo[0x6040].raw = 0x10F
    wait_for_speed(node, 0)
    wait_for(node, "enabled", lambda word: word & 0x6F == 0x27)
    node.sdo[0x6040].raw = 0x0F
    wait_for_speed(node, 5000)


@pytest.mark.parametrize("option", [0, 1, 2])
def test_a_fault_ends_at_rest_with_each_reaction_of_605e(bus: Drives, node: Any, option: int) -> None:
    node.sdo[0x605E].raw = option
    run(node, 5000)
    bus.drive(NODE).begin("fault")
    with pytest.raises(DriveFault):
        wait_for(node, "a fault", lambda _: False)
    end_s = time.monotonic() + 10
    while node.sdo[0x6041].raw & 0x4F != 0x08 or abs(node.sdo[0x606C].raw) >= 500:
        assert time.monotonic() < end_s, bus.drive(NODE).state


def test_lss_has_no_answer_and_node_guarding_no_frame(node: Any) -> None:
    node.network.lss.RESPONSE_TIMEOUT = 0.1
    with pytest.raises(canopen.lss.LssError, match="No LSS response"):
        node.network.lss.inquire_node_id()
    with pytest.raises(FrameError):
        node.network.send_message(0x700 + NODE, b"", remote=True)
