"""A bridge between the wire of the drives and another bus of python-can."""

import logging
import threading
import weakref

import can

from masseter_drives.errors import BridgeError

_LOG = logging.getLogger("can.masseter_drives")
#: The longest wait for a frame before a thread looks whether the bridge is closed.
_LOOK_S = 0.1
#: How long a frame may wait for room on the bus that takes the frame.
_ROOM_S = 1.0
#: The buses that bridges are on.
_joined: weakref.WeakSet[can.BusABC] = weakref.WeakSet()


class Bridge:
    """Carries classical data frames both ways, by a thread for each direction. The first error of a bus ends both."""

    def __init__(self, own: can.BusABC, other: can.BusABC) -> None:
        self._own, self._other = own, other
        self._about = f"{own.channel_info}, bridge to {other.channel_info}"
        self._is_open = True
        self._error: Exception | None = None
        #: Taken by the thread that ends first.
        self._ended = threading.Semaphore(1)
        #: Taken by the thread that frees the places: a bus may be on a newer bridge once they are free.
        self._left = threading.Semaphore(1)
        _joined.add(other)
        ways = [(own, other), (other, own)]
        self._threads = [threading.Thread(target=self._carry, args=way, name=self._about, daemon=True) for way in ways]
        for thread in self._threads:
            thread.start()

    @staticmethod
    def is_on(bus: can.BusABC) -> bool:
        """Whether a bridge carries the frames of a bus already."""
        return bus in _joined

    def _carry(self, source: can.BusABC, sink: can.BusABC) -> None:
        try:
            while self._is_open:
                message = source.recv(_LOOK_S)
                # A bus may be set to receive its own messages: those come from the drives.
                if message is None or not message.is_rx:
                    continue
                if not (message.is_remote_frame or message.is_fd or message.is_error_frame):
                    sink.send(message, timeout=_ROOM_S)
        except Exception as error:  # Each interface of python-can has errors of its own.
            if self._is_open:
                self._is_open = False
                _LOG.error("%s ended: %s", self._about, error)
                self._error = error
        finally:
            # The second thread that ends frees the place on the wire: nobody receives there any more.
            if not self._ended.acquire(blocking=False):
                self._leave()

    def _leave(self) -> None:
        if self._left.acquire(blocking=False):
            _joined.discard(self._other)
            self._own.shutdown()

    def check(self) -> None:
        """Raises the error that has ended the bridge."""
        if self._error is not None:
            raise BridgeError(f"{self._about} ended: {self._error}") from self._error

    def close(self) -> None:
        """Ends both threads. The other bus stays open. A thread is left behind whose frame the other bus does not take."""
        self._is_open = False
        for thread in self._threads:
            thread.join(2 * _ROOM_S)
        self._leave()
