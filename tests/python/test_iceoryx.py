"""Programs that use iceoryx2's own binding and the generated messages, without the rig's library: observers, and a stranger."""

import ctypes
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import iceoryx2  # type: ignore[import-untyped]
import pytest

import masseter
from masseter.messages import Command, DriveRequest, State


def private_folder() -> Path:
    """The folder of the rigs of this user, as docs/interface.md describes it."""
    if session := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(session) / "masseter"
    return Path("/run/masseter") if os.geteuid() == 0 else Path(f"/dev/shm/masseter-{os.geteuid()}")


def join(rig: str) -> "iceoryx2.Node":
    root = private_folder() / rig
    deadline = time.monotonic() + 20
    while not (root / "attach").exists() and not (root / "parameters").exists():
        assert time.monotonic() < deadline, "the rig is not there"
        time.sleep(0.01)
    config = iceoryx2.config.default()
    config.global_cfg.root_path = iceoryx2.Path.new(str(root))
    secret = (root / "lock").read_text()
    config.global_cfg.prefix = iceoryx2.FileName.new(f"masseter_{os.geteuid()}_{rig}.{secret}_")
    return iceoryx2.NodeBuilder.new().config(config).create(iceoryx2.ServiceType.Ipc)


def topic(node: "iceoryx2.Node", layout: type[ctypes.Structure]) -> "iceoryx2.PortFactoryPublishSubscribe":
    """The topic, as soon as a process of the rig has made it."""
    name = iceoryx2.ServiceName.new(layout.TOPIC)
    deadline = time.monotonic() + 20
    while True:
        try:
            return node.service_builder(name).publish_subscribe(layout).open()
        except iceoryx2.PublishSubscribeOpenError as error:
            if "DoesNotExist" not in str(error) or time.monotonic() > deadline:
                raise
            time.sleep(0.01)


@pytest.fixture
def rig(masseter_command: str, tmp_path: Path) -> Iterator[tuple[str, "subprocess.Popen[str]", Path]]:
    """A rig in real time: its name, its process and its folder."""
    name = f"ice-{os.getpid()}-{time.monotonic_ns() % 1_000_000}"
    arguments = ["--clock", "rt", "--duration", "3", "--name", name, "--out", str(tmp_path / "run"), "--quiet"]
    running = subprocess.Popen(
        [masseter_command, "run", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    yield name, running, tmp_path / "run"
    running.terminate()
    running.communicate(timeout=60)


def test_an_observer_sees_the_states_that_are_recorded(rig: tuple[str, "subprocess.Popen[str]", Path]) -> None:
    name, running, folder = rig
    subscriber = topic(join(name), State).subscriber_builder().create()
    seen: dict[int, tuple[float, ...]] = {}
    while running.poll() is None:
        while (sample := subscriber.receive()) is not None:
            state = sample.payload().contents
            seen[state.cycle] = tuple(state.desired_position_m)
        time.sleep(0.002)
    assert running.returncode in (0, 3)
    recorded = {int(state["cycle"]): tuple(state["desired_position_m"]) for state in masseter.load(folder).state}
    # A run that the machine disturbed may have ended early.
    assert len(seen) > (2000 if running.returncode == 0 else 0) and seen.items() <= recorded.items()


def test_a_message_with_a_field_of_another_name_is_refused(
    rig: tuple[str, "subprocess.Popen[str]", Path],
) -> None:
    class Renamed(ctypes.Structure):
        """As large as a state, and named after a layout with another field."""

        TOPIC = "state"
        _fields_ = [("bytes", ctypes.c_uint8 * ctypes.sizeof(State))]

        @staticmethod
        def type_name() -> str:
            return "masseter/State/0123456789abcdef"

    node = join(rig[0])
    assert topic(node, State) is not None
    with pytest.raises(iceoryx2.PublishSubscribeOpenError, match="IncompatibleTypes"):
        topic(node, Renamed)


def test_a_second_commander_stops_the_rig_safely_and_is_named(
    rig: tuple[str, "subprocess.Popen[str]", Path],
) -> None:
    name, running, folder = rig
    publisher = topic(join(name), Command).publisher_builder().create()
    time.sleep(1.5)
    number = 0
    while running.poll() is None:
        number += 1
        sample = publisher.loan_uninit()
        command = Command(
            seq=number,
            version=masseter.messages.LAYOUT_VERSION,
            published_ns=time.monotonic_ns(),
            cycle=1_000_000 + number,
            request=DriveRequest.OFF,
        )
        sample.write_payload(command).send()
        time.sleep(0.001)
    output = running.communicate()
    causes = {event["cause"] for event in masseter.load(folder).summary["figures"]["events"]}
    if running.returncode == 3 and not causes & {"foreign_command", "bad_message"}:
        pytest.skip("the machine disturbed the run before the second commander")
    assert running.returncode in (3, 5), output
    assert causes & {"foreign_command", "bad_message"}, causes
