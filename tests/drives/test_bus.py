"""The bus of the package masseter_drives, without another CANopen stack: settings, quirks, faults, and hostile use."""

import logging
import math
import os
import re
import signal
import subprocess
import sys
import threading
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import can
import pytest

from masseter_drives import (
    PROFILES,
    BusClosedError,
    Drives,
    FaultKind,
    FrameError,
    QueueFullError,
    QuirkKind,
    SettingError,
)

KINDS = Path(__file__).parents[2] / "shared/scenario/src/drive_profile/kinds"
#: Values of the quirks that need some.
VALUES: dict[str, dict[str, Any]] = {
    "acceleration_in_rpm_s": {"increments_per_turn": 4096},
    "slow_save": {"for_s": 2.0},
    "slow_brake": {"open_s": 0.1},
    "sto_at_power_on": {"for_s": 0.5},
    "second_encoder": {"limit_m": 1e-4},
    "fault_at_power_on": {"code": 0x3210},
    "restarts": {"after_s": 0.5},
    "late_watchdog": {"for_s": 0.5},
    "creeps": {"speed_m_s": 1e-3},
    "shows": {"object": (0x6065, 0), "value": 7},
    "lacks": {"object": (0x6065, 0)},
}
SIZES: dict[str, float] = {"torque_loss": 0.5, "slow_enable": 0.1, "scale": 1.1, "emcy_storm": 0.01}

Maker = Callable[..., Drives]


@pytest.fixture
def simulated(drives: Maker) -> Maker:
    return lambda *arguments, **settings: drives(*arguments, clock="simulated", **settings)


def frames(bus: can.BusABC, timeout: float) -> list[can.Message]:
    """What a bus receives until nothing comes for that time."""
    received = []
    while (message := bus.recv(timeout)) is not None:
        received.append(message)
    return received


def exchange(bus: Drives, node: int, request: list[int]) -> can.Message:
    """The answer to a request by SDO. A drive that boots gets the request again."""
    for _ in range(20):
        bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
        end_s = bus.now_s + 0.1
        while (message := bus.recv(max(end_s - bus.now_s, 0.0))) is not None:
            if message.arbitration_id == 0x580 + node:
                return message
    raise TimeoutError(f"node {node} answers no {bytes(request).hex()}")


def upload(bus: Drives, node: int, index: int, subindex: int = 0) -> int | str:
    """The value of an object, or the code of the abort."""
    answer = exchange(bus, node, [0x40, index & 0xFF, index >> 8, subindex, 0, 0, 0, 0])
    value = int.from_bytes(answer.data[4:], "little")
    return f"{value:08X}h" if answer.data[0] == 0x80 else value


def download(bus: Drives, node: int, index: int, value: int, size: int) -> None:
    command = 0x23 | (4 - size) << 2
    answer = exchange(bus, node, [command, index & 0xFF, index >> 8, 0, *value.to_bytes(4, "little")])
    assert answer.data[0] == 0x60, answer


def enable(bus: Drives, node: int) -> None:
    download(bus, node, 0x6060, 1, size=1)
    for controlword in (0x06, 0x07, 0x0F):
        download(bus, node, 0x6040, controlword, size=2)


def test_drives_boot_in_under_a_second_and_the_plugin_finds_them(simulated: Maker) -> None:
    bus = simulated("line", nodes=[1, 2, 3], profile="epos4")
    booted = [bus.recv(1.0) for _ in range(3)]
    assert [(message.arbitration_id, bytes(message.data)) for message in booted if message] == [
        (0x700 + node, b"\0") for node in (1, 2, 3)
    ]
    assert bus.now_s < 0.1
    with can.Bus(interface="masseter", channel="line") as other:
        assert isinstance(other, Drives)
        assert upload(other, 2, 0x1018, 1) == 0xFB
    assert {"interface": "masseter", "channel": "line"} in can.detect_available_configs("masseter")


def test_the_same_simulated_time_gives_the_same_frames(simulated: Maker) -> None:
    def run() -> list[tuple[float, int, bytes]]:
        bus = simulated(nodes=[1, 2])
        enable(bus, 1)
        bus.drive(1).begin("torque_loss", 1.0)
        bus.drive(1).load_n = 50.0
        bus.advance(0.3)
        return [(message.timestamp, message.arbitration_id, bytes(message.data)) for message in frames(bus, 0.0)]

    first = run()
    assert any(number == 0x81 for _, number, _ in first), "an emergency of node 1"
    assert run() == first


def test_buses_of_one_wire_see_each_other_and_drives_of_two_wires_do_not(simulated: Maker) -> None:
    one, other = simulated("one", nodes=[1]), simulated("other", nodes=[1])
    third = Drives("one")
    one.send(can.Message(arbitration_id=0x123, data=b"hello", is_extended_id=False))
    one.advance(0.01)
    assert [bytes(message.data) for message in frames(third, 0.0)] == [b"hello"]
    assert frames(one, 0.0) == [] and other.now_s == 0.0
    one.drive(1).begin("fault")
    one.advance(0.1)
    other.advance(0.1)
    assert [one.drive(1).state, other.drive(1).state] == ["fault", "switch_on_disabled"]
    third.shutdown()


def test_real_time_passes_by_itself(drives: Maker) -> None:
    bus = drives(nodes=[5])
    message = bus.recv(10.0)
    assert message is not None and message.arbitration_id == 0x705
    assert upload(bus, 5, 0x6041) == 0x250
    with pytest.raises(SettingError, match="passes by itself"):
        bus.advance(1.0)


@pytest.mark.parametrize("clock", ["real", "simulated"])
def test_a_network_has_drives_that_have_booted(drives: Maker, clock: str) -> None:
    bus = drives(nodes=[5], quirks=["two_boot_ups"], clock=clock)
    bus.network()
    assert [message.data for message in frames(bus, 0.0)[:2]] == [b"\0", b"\0"]


@pytest.mark.parametrize("kind", get_args(QuirkKind))
def test_every_quirk_boots_and_shows_in_the_data_sheet_or_on_the_bus(simulated: Maker, kind: str) -> None:
    quirk = {"kind": kind, **VALUES[kind]} if kind in VALUES else kind
    bus = simulated(nodes={1: {"quirks": [quirk]}, 2: {}})
    bus.advance(0.2)
    boot_ups = [message for message in frames(bus, 0.0) if message.arbitration_id == 0x701 and message.data == b"\0"]
    assert len(boot_ups) == (2 if kind == "two_boot_ups" else 1)
    effects = {
        "fault_at_power_on": lambda: bus.drive(1).state == "fault",
        "shows": lambda: upload(bus, 1, 0x6065) == 7,
        "lacks": lambda: upload(bus, 1, 0x6065) == "06020000h",
        "missing_objects": lambda: upload(bus, 1, 0x6066) == "06020000h",
        "interpolation_in_ms": lambda: upload(bus, 1, 0x60C2, 2) == 0xFD,
        "incremental_encoder": lambda: upload(bus, 1, 0x6064) == 0,
        "narrow_limits": lambda: upload(bus, 1, 0x6066) == 0,
    }
    assert effects.get(kind, lambda: True)()
    assert upload(bus, 2, 0x6065) == 2000, "the other drive has no quirk"


def listed(refusal: pytest.ExceptionInfo[SettingError]) -> set[str]:
    return set(re.findall("`(.*?)`", refusal.value.need)) - {"wrong"}


def test_the_names_of_quirks_and_faults_are_those_of_the_drives(simulated: Maker) -> None:
    with pytest.raises(SettingError) as refusal:
        simulated(nodes=[1], quirks=["wrong"])
    assert listed(refusal) == set(get_args(QuirkKind))
    bus = simulated(nodes=[1])
    with pytest.raises(SettingError) as refusal:
        bus.drive(1).begin("wrong")  # type: ignore[arg-type]
    assert listed(refusal) == set(get_args(FaultKind))


@pytest.mark.parametrize("kind", get_args(FaultKind))
def test_every_fault_begins_and_ends(simulated: Maker, kind: FaultKind) -> None:
    bus = simulated(nodes=[1])
    enable(bus, 1)
    drive = bus.drive(1)
    drive.begin(kind, SIZES.get(kind))
    bus.advance(0.1)
    if kind in ("fault", "reboot", "sto"):
        assert drive.state != "operation_enabled"
    if kind in ("fault", "reboot", "runaway", "emcy_storm"):
        assert drive.has_struck(kind)
    drive.end(kind)
    bus.advance(0.1)
    with pytest.raises(SettingError, match="size"):
        drive.begin(kind, None if kind in SIZES else 1.0)


def test_loads_and_encoders_act_while_the_drive_runs(simulated: Maker) -> None:
    bus = simulated(nodes=[1], quirks=[{"kind": "second_encoder", "limit_m": 1e-4}], stroke_m=(0.0, 0.2))
    enable(bus, 1)
    drive = bus.drive(1)
    bus.advance(0.2)
    assert drive.position_m == pytest.approx(0.1, abs=1e-5)
    drive.load_n = 100.0
    bus.advance(0.5)
    assert drive.position_m == pytest.approx(0.1, abs=1e-5), "the servo carries the load"
    drive.encoder_error_m = 5e-4
    bus.advance(0.1)
    assert drive.state == "fault", "two encoders disagree"


def test_a_stuck_encoder_hides_that_its_axis_falls(simulated: Maker) -> None:
    bus = simulated(nodes=[1], quirks=["no_brake"])
    drive = bus.drive(1)
    bus.advance(0.1)
    drive.stick_encoder()
    drive.load_n = 10.0
    bus.advance(0.1)
    assert upload(bus, 1, 0x6064) == 150_000 and drive.position_m < 0.1
    drive.stick_encoder(False)
    bus.advance(0.001)
    assert upload(bus, 1, 0x6064) in range(100_000)


@pytest.mark.parametrize("profile", ["epos4", "n5"])
def test_a_profile_has_the_identity_that_the_rig_expects_of_the_drive(simulated: Maker, profile: str) -> None:
    identity = tomllib.loads((KINDS / f"{profile}.toml").read_text())["identity"]
    shown = PROFILES[profile]["identity"]
    assert shown == {key: identity[key] for key in shown}
    assert upload(simulated(nodes=[1], profile=profile), 1, 0x1018, 2) == identity["product_code"]


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"nodes": [0]}, "nodes"),
        ({"nodes": [128]}, "nodes"),
        ({"nodes": [300]}, "nodes"),
        ({"nodes": [-1]}, "nodes"),
        ({"nodes": [4, 4]}, "nodes"),
        ({"nodes": []}, "nodes"),
        ({"nodes": ["1"]}, "settings"),
        ({"profile": "epos5"}, "profile"),
        ({"clock": "fast"}, "clock"),
        ({"bitrate": 0}, "bitrate"),
        ({"bitrate": 2_000_000}, "bitrate"),
        ({"queue": 0}, "queue"),
        ({"colour": "red"}, "settings"),
        ({"quirks": [{"for_s": 1.0}]}, "quirks"),
        ({"quirks": ["slow_save"]}, "quirks"),
        ({"quirks": [{"kind": "slow_save", "for_s": -1.0}]}, "quirks"),
        ({"quirks": [{"kind": "no_brake", "for_s": 1.0}]}, "quirks"),
        ({"quirks": [{"kind": "lacks", "object": (0x5555, 0)}]}, "quirks"),
        ({"ratings": {"max_force_n": 0.0}}, "max_force_n"),
        ({"ratings": {"force": 1.0}}, "settings"),
        ({"stroke_m": (0.2, 0.1)}, "stroke_m"),
        ({"stroke_m": (0.0, math.inf)}, "settings"),
    ],
)
def test_a_wrong_setting_is_refused_by_its_key(settings: dict[str, Any], key: str) -> None:
    with pytest.raises(SettingError) as refusal:
        Drives("refused", **{"nodes": [1], **settings})
    assert refusal.value.key == key, refusal.value
    assert isinstance(refusal.value, can.CanInitializationError) and isinstance(refusal.value, ValueError)
    Drives("refused", nodes=[1]).shutdown()


def test_a_bus_joins_only_what_is_there_and_at_its_bit_rate(simulated: Maker) -> None:
    bus = simulated("slow", nodes=[1], bitrate=250_000)
    refused: list[tuple[dict[str, Any], str]] = [
        ({"channel": "nowhere"}, "channel"),
        ({"channel": "slow", "bitrate": 500_000}, "bitrate"),
        ({"channel": "slow", "quirks": ["no_brake"]}, "quirks"),
        ({"channel": "slow", "nodes": [2]}, "channel"),
    ]
    for settings, key in refused:
        with pytest.raises(SettingError) as refusal:
            can.Bus(interface="masseter", **settings)
        assert refusal.value.key == key
    with pytest.raises(SettingError, match="node = 7"):
        bus.drive(7)
    joined = [Drives("slow", bitrate=250_000) for _ in range(7)]
    with pytest.raises(SettingError, match="close one"):
        Drives("slow")
    joined.pop().shutdown()
    joined.append(Drives("slow"))
    for other in joined:
        other.shutdown()


def test_one_wire_carries_every_node_of_canopen(simulated: Maker) -> None:
    bus = simulated(nodes=range(1, 128), heartbeat_ms=0)
    assert sorted(message.arbitration_id for message in frames(bus, 0.1)) == list(range(0x701, 0x780))
    assert upload(bus, 127, 0x6041) == 0x250
    with pytest.raises(SettingError, match="close one"):
        Drives(bus.channel)


def test_who_never_reads_loses_the_newest_frames_and_is_told_how_many(
    simulated: Maker, caplog: pytest.LogCaptureFixture
) -> None:
    bus = simulated(nodes=[1], queue=10)
    bus.advance(2.0)
    with caplog.at_level(logging.WARNING, logger="can"):
        kept = frames(bus, 0.0)
    assert len(kept) == 10 and kept[0].data == b"\0"
    assert bus.lost > 20 and f"{bus.lost} received frames lost" in caplog.text
    bus.advance(2.0)
    before = bus.lost
    with caplog.at_level(logging.WARNING, logger="can"):
        bus.shutdown()
    assert f"{bus.lost - before} received frames lost" in caplog.text


def test_a_burst_waits_for_the_wire_or_is_refused(simulated: Maker) -> None:
    bus = simulated(nodes=[1])
    burst = [can.Message(arbitration_id=0x400 + number, is_extended_id=False) for number in range(300)]
    with pytest.raises(QueueFullError):
        for message in burst:
            bus.send(message)
    for message in burst:
        bus.send(message, timeout=1.0)
    assert bus.state is can.BusState.ACTIVE


def test_a_frame_that_is_not_classical_is_refused(simulated: Maker) -> None:
    bus = simulated(nodes=[1])
    for options in [{"is_remote_frame": True}, {"is_fd": True}, {"is_error_frame": True}]:
        with pytest.raises(FrameError):
            bus.send(can.Message(arbitration_id=1, **options))
    with pytest.raises(FrameError):
        bus.send(can.Message(arbitration_id=0x10001, is_extended_id=False, check=False))


def test_a_bus_closes_while_frames_are_pending_and_a_thread_waits(drives: Maker) -> None:
    bus = drives("closing", nodes=[1], heartbeat_ms=0)
    other = Drives("closing")
    ended: list[BaseException] = []
    is_waiting = threading.Event()

    def wait() -> None:
        is_waiting.set()
        try:
            while True:
                other.recv()
        except BusClosedError as error:
            ended.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    is_waiting.wait()
    for number in range(20):
        bus.send(can.Message(arbitration_id=number, is_extended_id=True))
    bus.shutdown()
    bus.shutdown()
    thread.join()
    assert ended
    for closed in (bus, other):
        with pytest.raises(BusClosedError):
            closed.send(can.Message(arbitration_id=1))
    other.shutdown()
    Drives("closing", nodes=[1]).shutdown()


def test_a_child_process_has_no_share_in_the_drives(drives: Maker) -> None:
    bus = drives("forked", nodes=[1])
    child = os.fork()
    if child == 0:
        code = 1
        try:
            bus.recv(0.0)
        except BusClosedError as error:
            with Drives("forked", nodes=[2], clock="simulated") as own:
                code = 0 if "after the fork" in str(error) and own.recv(1.0) is not None else 2
            bus.shutdown()
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert upload(bus, 1, 0x6041) == 0x250


@pytest.mark.parametrize("clock", ["real", "simulated"])
def test_ctrl_c_ends_a_program_that_waits_for_a_silent_bus(clock: str) -> None:
    # A shell's background job ignores Ctrl-C, and so do its children.
    program = f"""
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from masseter_drives import Drives
with Drives(nodes=[1], clock={clock!r}, heartbeat_ms=0) as bus:
    bus.recv()
    print("waits", flush=True)
    bus.recv()
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as started:
        assert started.stdout is not None and started.stderr is not None
        assert started.stdout.readline() == "waits\n"
        started.send_signal(signal.SIGINT)
        try:
            _, told = started.communicate(timeout=60)
        finally:
            started.kill()
        assert "KeyboardInterrupt" in told and started.returncode != 0
