"""Drives over another bus of python-can: the interface "virtual", and socketcand with the rig's server as the peer."""

import io
import os
import re
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import can
import canopen
import pytest
from program import enable, move, reset

from masseter_drives import BridgeError, Drives, SettingError

Maker = Callable[..., Drives]


@contextmanager
def virtual(channel: str, **settings: Any) -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel=channel, **settings) as bus:
        yield bus


def frame(number: int, data: bytes = b"", **options: Any) -> can.Message:
    return can.Message(arbitration_id=number, data=data, is_extended_id=False, **options)


def arrived(bus: can.BusABC) -> int:
    """The identifier of the next frame."""
    message = bus.recv(10.0)
    assert message is not None, "a silent bus"
    return message.arbitration_id


def heard(bus: can.BusABC, number: int) -> can.Message:
    """The next frame with this identifier."""
    for _ in range(10_000):
        if (message := bus.recv(10.0)) is not None and message.arbitration_id == number:
            return message
    raise TimeoutError(f"no frame {number:03X}")


def boot(network: canopen.Network, drives: Drives, node: int) -> Any:
    """A drive by its data sheet, reset by the network."""
    sheet: Any = io.StringIO(drives.drive(node).eds)
    sheet.name = f"{node}.eds"
    remote = network.add_node(node, sheet)
    reset(remote)
    return remote


def test_a_master_on_another_bus_boots_and_moves_the_drives(drives: Maker) -> None:
    with virtual("line") as wire:
        bus = drives(nodes=[1, 2])
        bus.serve(wire)
        with canopen.Network() as network:
            network.connect(interface="virtual", channel="line")
            node = boot(network, bus, 2)
            enable(node)
            assert abs(move(node, 2000) - 2000) < 20
            assert [bus.drive(1).state, bus.drive(2).state] == ["switch_on_disabled", "operation_enabled"]


@contextmanager
def socketcand_server() -> Iterator[dict[str, Any]]:
    """The arguments of a bus at the rig's server, which has the drives 1 to 3 on can0."""
    command = [os.environ["MASSETER"], "can", "serve", "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        try:
            assert server.stderr is not None
            ports = (re.search(r"socketcand protocol on .*:(\d+);", line) for line in server.stderr)
            port = next(filter(None, ports))[1]
            # A full pipe would hold the server up.
            threading.Thread(target=server.stderr.read, daemon=True).start()
            yield {"interface": "socketcand", "host": "127.0.0.1", "port": int(port), "channel": "can0"}
        finally:
            server.kill()


def test_a_master_at_a_socketcand_server_moves_drives_that_a_bridge_brings_there(drives: Maker) -> None:
    with socketcand_server() as there, can.Bus(**there) as wire:
        bus = drives(nodes=[77], profile="n5")
        bus.serve(wire)
        with canopen.Network() as network:
            network.connect(**there)
            node = boot(network, bus, 77)
            assert node.sdo[0x1018][1].raw == 0x26C
            enable(node)
            assert abs(move(node, 2000) - 2000) < 20
            heard_of = threading.Event()
            network.subscribe(0x581, lambda *_: heard_of.set())
            network.send_message(0x601, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0]))
            assert heard_of.wait(10), "the server's own drives are on the same wire"
        # The user's bus is on the wire, too.
        bus.send(frame(0x601, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0])))
        assert heard(bus, 0x581).data[0] == 0x43


def test_drives_of_two_wires_meet_on_a_third_bus(drives: Maker) -> None:
    with virtual("both") as one, virtual("both") as other, virtual("both") as master:
        drives(nodes=[1]).serve(one)
        drives(nodes=[2], profile="epos4").serve(other)
        for node, vendor in [(1, 0x4D5354), (2, 0xFB)]:
            heard(master, 0x700 + node)
            master.send(frame(0x600 + node, bytes([0x40, 0x18, 0x10, 1, 0, 0, 0, 0])))
            answer = heard(master, 0x580 + node)
            assert answer.data[0] == 0x43 and int.from_bytes(answer.data[4:], "little") == vendor


def test_no_frame_comes_back_to_the_wire_that_sent_it(drives: Maker) -> None:
    with virtual("echo", receive_own_messages=True) as wire, virtual("echo") as master:
        bus = drives(nodes=[1], heartbeat_ms=0)
        bus.serve(wire)
        bus.send(frame(0x321))
        assert heard(master, 0x321)
        master.send(frame(0x322))
        before = list(iter(lambda: arrived(bus), 0x322))
        assert 0x321 not in before


def test_only_classical_data_frames_cross_and_others_end_nothing(drives: Maker) -> None:
    with virtual("kinds", protocol=can.CanProtocol.CAN_FD) as wire, virtual("kinds", protocol=can.CanProtocol.CAN_FD) as master:
        bus = drives(nodes=[1])
        bus.serve(wire)
        master.send(frame(0x651, is_remote_frame=True))
        master.send(frame(0x652, bytes(12), is_fd=True, dlc=12))
        master.send(frame(0x653, is_error_frame=True))
        master.send(frame(0x654, b"data"))
        assert not {0x651, 0x652, 0x653} & set(iter(lambda: arrived(bus), 0x654))


def test_a_bridge_needs_real_time_and_another_wire(drives: Maker) -> None:
    with virtual("refused") as wire:
        with pytest.raises(SettingError, match="clock='real'"):
            drives(nodes=[1], clock="simulated").serve(wire)
    bus = drives("own", nodes=[1])
    with Drives("own") as joined, pytest.raises(SettingError, match="already"):
        bus.serve(joined)
    slow = drives("slow", nodes=[1], clock="simulated")
    with pytest.raises(SettingError, match="its time is simulated"):
        bus.serve(slow)
    with virtual("twice") as wire:
        bus.serve(wire)
        with pytest.raises(SettingError, match="joined to this bus already"):
            bus.serve(wire)


class Stuck(can.BusABC):
    """A bus that takes no frame."""

    channel_info = "stuck"

    def __init__(self) -> None:
        self.waits, self.is_free = threading.Event(), threading.Event()
        super().__init__("stuck")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.waits.set()
        self.is_free.wait()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self.is_free.wait(timeout)
        return None, False


def test_a_bus_that_takes_no_frame_does_not_hold_up_the_end(drives: Maker) -> None:
    with Stuck() as stuck:
        bus = drives(nodes=[1])
        bus.serve(stuck)
        assert stuck.waits.wait(30)
        end = threading.Thread(target=bus.shutdown, daemon=True)
        end.start()
        end.join(30)
        assert not end.is_alive()
        stuck.is_free.set()


def test_a_thread_left_behind_takes_no_bus_from_a_newer_bridge(drives: Maker) -> None:
    before = set(threading.enumerate())
    with Stuck() as stuck:
        old = drives("old", nodes=[1])
        old.serve(stuck)
        assert stuck.waits.wait(30)
        old.shutdown()
        left = set(threading.enumerate()) - before
        assert left
        drives("newer", nodes=[1]).serve(stuck)
        stuck.is_free.set()
        for way in left:
            way.join(30)
            assert not way.is_alive()
        with pytest.raises(SettingError, match="joined to this bus already"):
            drives("newest", nodes=[1]).serve(stuck)


def test_an_error_of_the_other_bus_reaches_the_user_with_its_cause(drives: Maker, caplog: pytest.LogCaptureFixture) -> None:
    bus = drives("failed", nodes=[1])
    before = set(threading.enumerate())
    with virtual("fails") as wire:
        bus.serve(wire)
        heard(bus, 0x701)
        ways = set(threading.enumerate()) - before
    with pytest.raises(BridgeError, match="closed bus") as failure:
        heard(bus, 0x000)
    assert isinstance(failure.value.__cause__, can.CanOperationError)
    assert "bridge to Virtual bus channel fails ended" in caplog.text
    for way in ways:
        way.join(30)
        assert not way.is_alive()
    with ExitStack() as others:
        for _ in range(7):
            others.enter_context(Drives("failed"))


def test_a_lost_server_is_an_error_at_the_next_frame_of_a_drive(drives: Maker) -> None:
    with ExitStack() as server:
        there = server.enter_context(socketcand_server())
        with can.Bus(**there) as wire:
            bus = drives(nodes=[77])
            bus.serve(wire)
            heard(bus, 0x700 + 77)
            server.close()
            with pytest.raises(BridgeError, match="socketcand on can0") as failure:
                heard(bus, 0x000)
            assert isinstance(failure.value.__cause__, OSError | can.CanError)
            bus.shutdown()


def test_a_bridge_ends_with_its_bus_while_frames_are_on_their_way(drives: Maker) -> None:
    before = set(threading.enumerate())
    with virtual("busy") as wire, virtual("busy") as master:
        bus = drives("bridged", nodes=[1])
        bus.serve(wire)
        for number in range(2000):
            master.send(frame(0x400 + number % 0x100, b"12345678"))
        heard(bus, 0x400)
        bus.shutdown()
        assert set(threading.enumerate()) <= before
        master.send(frame(0x123))
        assert heard(wire, 0x123), "the other bus stays the user's"
        drives("bridged", nodes=[1]).serve(wire)
