"""A user's program on python-canopen: enables a drive and moves it, and raises where the drive fails."""

import queue
import time
from collections.abc import Callable
from typing import Any


class DriveFault(Exception):
    """The drive is in fault."""


def wait_for(node: Any, what: str, holds: Callable[[int], bool], seconds: float = 10.0) -> None:
    end_s = time.monotonic() + seconds
    while not holds(statusword := node.sdo[0x6041].raw):
        if statusword & 0x08:
            raise DriveFault(f"node {node.id}: {node.sdo[0x603F].raw:04X}h")
        if time.monotonic() > end_s:
            raise TimeoutError(f"node {node.id}: {what}")


def reset(node: Any) -> None:
    """Resets a node that has booted, and waits until the node has booted again.

    `wait_for_bootup` of python-canopen misses a boot-up message that comes before the wait.
    """
    states: queue.SimpleQueue[int] = queue.SimpleQueue()
    node.nmt.add_heartbeat_callback(states.put)
    for expected, command in [(127, "RESET"), (0, None)]:
        while states.get(timeout=10.0) != expected:
            pass
        if command:
            node.nmt.state = command


def enable(node: Any) -> None:
    node.sdo[0x6060].raw = 1
    for controlword, mask, state in [(0x06, 0x6F, 0x21), (0x07, 0x6F, 0x23), (0x0F, 0x6F, 0x27)]:
        node.sdo[0x6040].raw = controlword
        wait_for(node, f"state {state:02X}h", lambda word: word & mask == state)


def move(node: Any, increments: int) -> int:
    """Moves by so many increments, and returns how far the axis has come."""
    start: int = node.sdo[0x6064].raw
    node.sdo[0x6081].raw = 100_000
    node.sdo[0x607A].raw = start + increments
    node.sdo[0x6040].raw = 0x1F
    wait_for(node, "acknowledged", lambda word: bool(word & 1 << 12))
    node.sdo[0x6040].raw = 0x0F
    wait_for(node, "target reached", lambda word: bool(word & 1 << 10))
    end: int = node.sdo[0x6064].raw
    return end - start
