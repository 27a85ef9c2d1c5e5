"""Emulated CiA 402 servo drives as a bus of python-can. The README of the package is the guide."""

import contextlib
import io
import itertools
import json
import logging
import math
import os
import threading
import time
from collections.abc import Iterable, Mapping
from typing import Any, Literal

import can

from masseter_drives._native import Bench, __version__
from masseter_drives.bridge import Bridge
from masseter_drives.errors import (
    BridgeError,
    BusClosedError,
    BusOffError,
    DrivesError,
    FrameError,
    QueueFullError,
    SettingError,
)
from masseter_drives.profiles import PROFILES, FaultKind, QuirkKind

__all__ = [
    "PROFILES", "BridgeError", "BusClosedError", "BusOffError", "Drive", "Drives", "DrivesError", "FaultKind", "FrameError",
    "QueueFullError", "QuirkKind", "SettingError", "__version__",
]  # fmt: skip

_LOG = logging.getLogger("can.masseter_drives")
#: The longest time that passes in one call of the native part, which signals of the system do not interrupt.
_SLICE_NS = 10_000_000
#: When every drive has booted: 20 ms after power-on, or twice that with a boot-up message of the boot loader.
_BOOTED_NS = 50_000_000
#: How often a bus in real time looks for frames.
_LOOK_S = 0.001


class _World:
    """Drives with their clock, shared by the buses of a channel."""

    def __init__(self, nodes: list[int], bench: Bench, bitrate: int, clock: str) -> None:
        self.nodes, self.bench, self.bitrate, self.is_real = nodes, bench, bitrate, clock == "real"
        self.is_open, self.pid = True, os.getpid()
        self.start_ns, self.epoch_s = time.monotonic_ns(), time.time() if self.is_real else 0.0

    def checked(self) -> Bench:
        if os.getpid() != self.pid:
            raise BusClosedError(f"the drives belong to process {self.pid}; make the bus after the fork")
        if not self.is_open:
            raise BusClosedError("the drives are switched off: the bus that made them is closed")
        return self.bench

    def now_ns(self) -> int:
        return time.monotonic_ns() - self.start_ns if self.is_real else self.checked().now_ns()

    def until_ns(self, deadline_ns: float) -> int:
        """Up to where time passes in the next call."""
        end_ns = self.now_ns() if self.is_real else deadline_ns
        return int(min(self.checked().now_ns() + _SLICE_NS, end_ns))

    def advance(self, until_ns: int) -> None:
        while (reached_ns := self.checked().now_ns()) < until_ns:
            self.bench.advance(min(until_ns, reached_ns + _SLICE_NS))

    def at_present(self) -> Bench:
        """The drives, in real time brought to the present."""
        if self.is_real:
            self.advance(self.now_ns())
        return self.checked()

    def rest(self, reached_ns: int) -> None:
        """Waits in real time, once the drives have reached the present."""
        if self.is_real and self.now_ns() - reached_ns < _SLICE_NS:
            time.sleep(_LOOK_S)


_worlds: dict[str, _World] = {}
_lock = threading.Lock()
_numbers = itertools.count(1)


def _forget_worlds() -> None:
    global _lock
    _lock = threading.Lock()
    _worlds.clear()


os.register_at_fork(after_in_child=_forget_worlds)


def _named(quirk: QuirkKind | Mapping[str, Any]) -> dict[str, Any]:
    return {"kind": quirk} if isinstance(quirk, str) else dict(quirk)


def _merged(*layers: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of which the later replace the earlier; quirks add up, and tables are merged."""
    merged: dict[str, Any] = {}
    for key, value in itertools.chain.from_iterable(layer.items() for layer in layers):
        if key == "quirks":
            value = [*merged.get(key, []), *map(_named, value)]
        merged[key] = {**merged.get(key, {}), **value} if isinstance(value, Mapping) else value
    return merged


class Drive:
    """One drive, as its maker sees it: what it moves, and what is broken. Masters talk to it by the bus."""

    def __init__(self, world: _World, node: int) -> None:
        self._world, self.node = world, node
        world.checked().power_state(node)

    @staticmethod
    def _value(name: str, about: str) -> property:
        def read(self: "Drive") -> float:
            return self._world.at_present().value(self.node, name)

        def write(self: "Drive", value: float) -> None:
            self._world.at_present().set_value(self.node, name, value)

        return property(read, write, doc=about)

    position_m = _value("position_m", "Position of the axis.")
    velocity_m_s = _value("velocity_m_s", "Velocity of the axis.")
    mass_kg = _value("mass_kg", "Mass on the axis.")
    load_n = _value("load_n", "Force on the axis towards smaller positions.")
    encoder_error_m = _value("encoder_error_m", "How much more than the position the encoder shows.")

    @property
    def state(self) -> str:
        """State under CiA 402, such as "operation_enabled"."""
        return self._world.at_present().power_state(self.node)

    @property
    def eds(self) -> str:
        """The electronic data sheet (CiA 306)."""
        return self._world.checked().eds(self.node)

    def begin(self, fault: FaultKind, size: float | None = None) -> None:
        """Begins a fault. `torque_loss` takes a share, `scale` a ratio, `slow_enable` and `emcy_storm` seconds."""
        self._world.at_present().set_fault(self.node, fault, True, size)

    def end(self, fault: FaultKind) -> None:
        """Ends a fault."""
        self._world.at_present().set_fault(self.node, fault, False)

    def has_struck(self, fault: FaultKind) -> bool:
        """Whether the fault has had an effect since it began."""
        return self._world.at_present().has_struck(self.node, fault)

    def stick_encoder(self, is_stuck: bool = True) -> None:
        """The encoder shows the present position from now on, or works again."""
        self._world.at_present().stick_encoder(self.node, is_stuck)


class Drives(can.BusABC):
    """A bus of python-can with emulated drives: with `nodes` new drives, without them another bus on the wire of `channel`.

    `nodes` are ids, or a dictionary of ids with the settings of single drives. Further settings are for all drives.
    """

    def __init__(
        self,
        channel: str | None = None,
        nodes: Iterable[int] | Mapping[int, Mapping[str, Any]] | None = None,
        profile: str = "emulated",
        *,
        clock: Literal["real", "simulated"] = "real",
        bitrate: int | None = None,
        queue: int = 1000,
        can_filters: Any = None,
        **settings: Any,
    ) -> None:
        with _lock:
            if nodes is None:
                self._world = self._joined(channel, bitrate, settings)
            else:
                channel = f"drives {next(_numbers)}" if channel is None else channel
                self._world = self._made(channel, nodes, profile, clock, bitrate, queue, settings)
            self._bus = self._world.bench.join()
            _worlds[str(channel)] = self._world
        self.channel, self._is_maker = str(channel), nodes is not None
        #: Ids of the drives, and how many received frames this bus has lost because nobody read them.
        self.nodes, self.lost = self._world.nodes, 0
        self._networks: list[Any] = []
        self._bridges: list[Bridge] = []
        self.channel_info = f"emulated drives {self.nodes} on channel {self.channel!r}"
        super().__init__(self.channel, can_filters)

    @staticmethod
    def _joined(channel: str | None, bitrate: int | None, settings: Mapping[str, Any]) -> _World:
        world = _worlds.get(str(channel))
        if world is None:
            there = ", ".join(_worlds) or "none is there"
            raise SettingError("channel", channel, f"no drives; give nodes, or a channel with drives: {there}")
        for key, value in settings.items():
            raise SettingError(key, value, "the bus that gives nodes has the settings")
        if bitrate not in (None, world.bitrate):
            raise SettingError("bitrate", bitrate, f"the drives of this wire have {world.bitrate} bit/s")
        return world

    @staticmethod
    def _made(
        channel: str,
        nodes: Iterable[int] | Mapping[int, Mapping[str, Any]],
        profile: str,
        clock: str,
        bitrate: int | None,
        queue: int,
        settings: Mapping[str, Any],
    ) -> _World:
        if str(channel) in _worlds:
            raise SettingError("channel", channel, "this wire has drives; leave nodes away to join them")
        for key, value, known in [("profile", profile, PROFILES), ("clock", clock, ("real", "simulated"))]:
            if value not in known:
                raise SettingError(key, value, f"use one of {', '.join(known)}")
        own = dict(nodes) if isinstance(nodes, Mapping) else {}
        nodes, bitrate = list(nodes), 1_000_000 if bitrate is None else bitrate
        each = [_merged(PROFILES[profile], settings, own.get(node, {}), {"node": node}) for node in nodes]
        return _World(nodes, Bench(json.dumps(each), bitrate, queue), bitrate, clock)

    def _open(self) -> _World:
        self._world.checked()
        if self._is_shutdown:
            raise BusClosedError("this bus is closed")
        for bridge in self._bridges:
            bridge.check()
        return self._world

    @property
    def now_s(self) -> float:
        """Time since the drives were switched on."""
        return self._open().now_ns() * 1e-9

    def advance(self, time_s: float) -> None:
        """Lets simulated time pass. Received frames wait in the queue."""
        world = self._open()
        if world.is_real:
            raise SettingError("clock", "real", "this time passes by itself; make the drives with clock='simulated'")
        world.advance(world.now_ns() + round(time_s * 1e9))

    def drive(self, node: int) -> Drive:
        """A drive by its node id."""
        return Drive(self._open(), node)

    def network(self) -> Any:
        """A network of python-canopen on a bus of its own, with each booted drive by its data sheet. It ends with this bus."""
        import canopen

        world = self._open()
        while world.at_present().now_ns() < _BOOTED_NS:
            if not world.is_real:
                world.advance(_BOOTED_NS)
            world.rest(world.now_ns())
        network = canopen.Network(Drives(self.channel)).connect()
        self._networks.append(network)
        for node in self.nodes:
            sheet: Any = io.StringIO(self.drive(node).eds)
            sheet.name = f"{node}.eds"
            network.add_node(node, sheet)
        return network

    def serve(self, other: can.BusABC) -> None:
        """Joins another bus of python-can to the wire, until this bus closes: masters there find the drives.

        An error of the other bus is logged, and each later call of this bus but shutdown raises BridgeError. Join a wire to a channel
        once: over a second bus of one channel each frame would come back.
        """
        world = self._open()
        if not world.is_real:
            raise SettingError("clock", "simulated", "another bus has real time; make the drives with clock='real'")
        if isinstance(other, Drives) and other._world is world:
            raise SettingError("other", other.channel_info, "this bus is on the wire of the drives already")
        if isinstance(other, Drives) and not other._world.is_real:
            raise SettingError("other", other.channel_info, "its time is simulated; make its drives with clock='real'")
        if Bridge.is_on(other):
            raise SettingError("other", other.channel_info, "a wire of drives is joined to this bus already")
        self._bridges.append(Bridge(Drives(self.channel), other))

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.is_remote_frame or msg.is_fd or msg.is_error_frame:
            raise FrameError("the drives take classical data frames alone: no remote frame, no CAN FD, no error frame")
        world = self._open()
        deadline_ns = world.now_ns() + round((timeout or 0) * 1e9)
        frame = self._bus, msg.arbitration_id, msg.is_extended_id, bytes(msg.data)
        while not world.at_present().send(*frame):
            if (now_ns := world.now_ns()) >= deadline_ns:
                raise QueueFullError("the frames before this one still wait for the wire; let time pass, or give a timeout")
            if world.is_real:
                time.sleep(_LOOK_S)
            else:
                world.advance(min(deadline_ns, now_ns + _SLICE_NS // 10))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame. Simulated time passes until the frame is there, or for `timeout` seconds."""
        world = self._open()
        deadline_ns = math.inf if timeout is None else world.now_ns() + round(timeout * 1e9)
        while True:
            until_ns = self._open().until_ns(deadline_ns)
            received, lost = world.bench.receive(self._bus, until_ns)
            self._note(lost)
            if received is not None:
                time_ns, number, is_extended, data = received
                message = can.Message(
                    timestamp=world.epoch_s + time_ns * 1e-9,
                    arbitration_id=number,
                    is_extended_id=is_extended,
                    data=data,
                    channel=self.channel,
                )
                if self._matches_filters(message):
                    return message
            elif until_ns >= deadline_ns:
                return None
            else:
                world.rest(until_ns)

    def _note(self, lost: int) -> None:
        if lost > self.lost:
            _LOG.warning("%s: %d received frames lost; nobody read them in time", self.channel_info, lost - self.lost)
            self.lost = lost

    @property
    def state(self) -> can.BusState:
        """The fault confinement of this bus, which nobody sets."""
        states = can.BusState.ACTIVE, can.BusState.PASSIVE, can.BusState.ERROR
        return states[self._open().at_present().error_state(self._bus)]

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        raise NotImplementedError("the wire alone changes the state of a bus")

    def shutdown(self) -> None:
        """Closes the bus; the one that made the drives switches them off."""
        if self._is_shutdown:
            return
        with contextlib.ExitStack() as ends:
            ends.callback(self._leave)
            for end in [bridge.close for bridge in self._bridges] + [network.disconnect for network in self._networks]:
                ends.callback(end)

    def _leave(self) -> None:
        super().shutdown()
        if self._world.is_open and self._world.pid == os.getpid():
            self._note(self._world.bench.leave(self._bus))
            if self._is_maker:
                self._world.is_open = False
                _worlds.pop(self.channel, None)

    @staticmethod
    def _detect_available_configs() -> list[Any]:
        return [{"interface": "masseter", "channel": channel} for channel in list(_worlds)]
