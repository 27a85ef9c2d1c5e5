"""Forward and inverse kinematics over arrays."""

from os import PathLike

import numpy as np
from numpy.typing import ArrayLike, NDArray

from masseter import _native

Array = NDArray[np.float64]

_AXES = 6
_POSE = 7


class Mechanism:
    """The dimensions of a mechanism: those of a scenario file, or the published ones."""

    def __init__(self, scenario: str | PathLike[str] | None = None) -> None:
        self._native = _native.Mechanism(scenario)

    def fk(self, positions_m: ArrayLike) -> tuple[Array, Array]:
        """Positions d1 d2 d3 l1 l2 l3 in m, of shape (..., 6), to position (..., 3) in m and quaternion w x y z (..., 4).

        Rows that continue a motion are solved from the row before, which is proved in each row; any other row completely.
        Raises MasseterError with the first row that has no pose, and why.
        """
        positions = _rows(positions_m, _AXES, "positions_m")
        poses = np.frombuffer(self._native.forward(positions.tobytes())).reshape(*positions.shape[:-1], _POSE)
        return poses[..., :3], poses[..., 3:]

    def ik(self, position_m: ArrayLike, quaternion_wxyz: ArrayLike) -> Array:
        """Poses to positions d1 d2 d3 l1 l2 l3 in m, of shape (..., 6). The inverse of fk."""
        position = _rows(position_m, 3, "position_m")
        quaternion = _rows(quaternion_wxyz, 4, "quaternion_wxyz")
        poses = np.concatenate([position, quaternion], axis=-1)
        return np.frombuffer(self._native.inverse(poses.tobytes())).reshape(*poses.shape[:-1], _AXES)


def _rows(values: ArrayLike, length: int, name: str) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.shape[-1:] != (length,):
        raise ValueError(f"{name} has the shape {array.shape}; give (..., {length})")
    return array


def fk(positions_m: ArrayLike, mechanism: Mechanism | None = None) -> tuple[Array, Array]:
    """As Mechanism.fk, of the published mechanism by default.

    >>> position_m, quaternion_wxyz = fk([0, 0, 0, 0.27, 0.27, 0.27])
    >>> ik(position_m, quaternion_wxyz)[3:].round(6)
    array([0.27, 0.27, 0.27])
    """
    return (mechanism or Mechanism()).fk(positions_m)


def ik(position_m: ArrayLike, quaternion_wxyz: ArrayLike, mechanism: Mechanism | None = None) -> Array:
    """As Mechanism.ik, of the published mechanism by default."""
    return (mechanism or Mechanism()).ik(position_m, quaternion_wxyz)
