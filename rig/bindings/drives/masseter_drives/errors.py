"""The errors of the package. Each is an error of python-can, too."""

import can


class DrivesError(can.CanError):
    """What the drives or their bus refuse."""


class SettingError(DrivesError, can.CanInitializationError, ValueError):
    """A setting that makes no drives, or no bus."""

    def __init__(self, key: str, value: object, need: str) -> None:
        super().__init__(f"{key} = {value}: {need}")
        self.key, self.value, self.need = key, value, need


class BusClosedError(DrivesError, can.CanOperationError):
    """The bus is closed, or the drives are switched off."""


class BusOffError(DrivesError, can.CanOperationError):
    """The controller of this bus is off the wire after too many errors."""


class FrameError(DrivesError, can.CanOperationError, ValueError):
    """A frame that the wire does not carry."""


class QueueFullError(DrivesError, can.CanOperationError, TimeoutError):
    """No room for a frame: the wire is overloaded, or no time passes."""


class BridgeError(DrivesError, can.CanOperationError):
    """The bus beyond a bridge has failed; the cause is its error."""
