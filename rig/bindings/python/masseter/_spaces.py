"""The box of numbers that describes actions and observations, where gymnasium is not installed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Box:
    """Arrays of a shape whose numbers lie within limits: the part of gymnasium.spaces.Box that an environment needs."""

    def __init__(self, low: Any, high: Any, shape: tuple[int, ...], dtype: Any = np.float64) -> None:
        self.low = np.broadcast_to(np.asarray(low, dtype), shape)
        self.high = np.broadcast_to(np.asarray(high, dtype), shape)
        self.shape = shape
        self.dtype = np.dtype(dtype)
        self._random = np.random.default_rng()

    def seed(self, seed: int | None = None) -> None:
        self._random = np.random.default_rng(seed)

    def sample(self) -> NDArray[np.float64]:
        """A random array; a side without a limit takes the place 1 beyond the other one, or ±1."""
        low = np.where(np.isfinite(self.low), self.low, np.where(np.isfinite(self.high), self.high - 1, -1))
        high = np.where(np.isfinite(self.high), self.high, low + 1)
        return self._random.uniform(low, high)

    def contains(self, x: Any) -> bool:
        array = np.asarray(x)
        return array.shape == self.shape and bool(np.all(array >= self.low) and np.all(array <= self.high))

    __contains__ = contains

    def __repr__(self) -> str:
        return f"Box({self.low.min()}, {self.high.max()}, {self.shape}, {self.dtype})"


try:
    from gymnasium.spaces import Box as _Box
except ImportError:
    _Box = Box  # type: ignore[assignment, misc]


def box(low: Any, high: Any, shape: tuple[int, ...]) -> Any:
    """That of gymnasium where it is installed."""
    return _Box(low=low, high=high, shape=shape, dtype=np.float64)  # type: ignore[arg-type]
