"""The rig as an environment that steps: one process, simulated time, no shared memory. With gymnasium installed, its classes are
the bases of those here."""

import json
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from masseter import _native
from masseter._spaces import box

if TYPE_CHECKING:
    _Env = _VectorEnv = object
    _NEXT_STEP: Any = None
else:
    try:
        from gymnasium import Env as _Env
        from gymnasium.vector import VectorEnv as _VectorEnv
    except ImportError:
        _Env = _VectorEnv = object
    try:
        # Since gymnasium 1.1.
        from gymnasium.vector import AutoresetMode

        _NEXT_STEP = AutoresetMode.NEXT_STEP
    except ImportError:
        _NEXT_STEP = None

Array = NDArray[np.float64]
Action = Literal["targets", "pose", "forces"]
Reward = str | Callable[[Array, dict[str, Any]], float]

#: What an environment shows by default: what the drives report, and what the last command asked for.
OBSERVED = tuple(f"{axis}.{what}" for what in ("position", "velocity", "force", "target") for axis in ("d1", "d2", "d3", "l1", "l2", "l3"))


class ActionError(_native.MasseterError, ValueError):
    """An action of the wrong size, or with a number that is none. Nothing was played."""


class EnvStateError(_native.MasseterError, RuntimeError):
    """A call at the wrong time: a step before the first reset or after the end, or from another thread or process."""


class EnvArguments(NamedTuple):
    """What an environment is made of, as the native part reads it."""

    scenario: str | PathLike[str] | None
    #: Each KEY=VALUE.
    set: list[str]
    action: str
    observe: list[str]
    #: The name of a signal, and its sign.
    reward: tuple[str, float] | None
    requirement: str | None
    cycles_per_step: int


def _assignments(values: Mapping[str, Any] | None) -> list[str]:
    return [f"{key}={value if isinstance(value, str) else json.dumps(value)}" for key, value in (values or {}).items()]


def _signal(reward: Reward | None) -> tuple[str, float] | None:
    if reward is None:
        return None
    if not isinstance(reward, str):
        raise TypeError(f"the reward is a {type(reward).__name__}; give the name of a signal")
    return (reward.removeprefix("-"), -1.0 if reward.startswith("-") else 1.0)


def _numbers(action: ArrayLike, shape: tuple[int, ...], kind: Action) -> bytes:
    try:
        array = np.asarray(action, np.float64)
    except (TypeError, ValueError) as error:
        raise ActionError(f"the action is no array of numbers: {error}") from None
    if array.shape != shape:
        raise ActionError(f"the action has the shape {array.shape}, not {shape}")
    if not np.isfinite(array).all():
        place = int(np.flatnonzero(~np.isfinite(array))[0])
        raise ActionError(f"number {place} of the action is {array.flat[place]}; use finite numbers")
    if kind == "pose" and not np.linalg.norm(array[..., 3:], axis=-1).all():
        raise ActionError("the quaternion of the action has the length 0")
    return array.tobytes()


class Env(_Env):  # type: ignore[misc]
    """A scenario that goes on by one action a step. Physics, drives, buses, faults, stimuli and safety are those of a run.

        env = masseter.Env("soft_food.toml", action="targets", reward="-incisal.error")
        observation, info = env.reset(seed=1)
        observation, reward, terminated, truncated, info = env.step(action)

    action: what an action is, for the cycle whose reading the observation shows.
        "targets": positions d1 d2 d3 l1 l2 l3, m, in place of the controller's.
        "pose": position, m, and quaternion w x y z, which is brought to length 1; the answer of a pose law.
        "forces": forces that the drives add to their own, N, beside the controller's targets; needs 60B2h in rpdo1.
    observe: names of signals (masseter signals), in their units. A signal without a value keeps its last one, at first 0.
    reward: the name of a signal, with a minus for its negative: the mean over the step; or a function of observation and info.
    requirement: in place of reward, the name of a requirement, whose margin so far is the reward; 0 before it has one.
    set: values of the scenario by their keys. cycles_per_step: how many cycles an action lasts.

    An episode begins with the motion: reset plays the start, in which the rig's controller acts. It is terminated by a safe
    stop, and truncated when the motion is over. An environment belongs to the thread that made it.
    """

    metadata: dict[str, Any] = {"render_modes": []}
    render_mode = None

    def __init__(
        self,
        scenario: str | PathLike[str] | None = None,
        *,
        action: Action = "targets",
        observe: Sequence[str] = OBSERVED,
        reward: Reward | None = None,
        requirement: str | None = None,
        set: Mapping[str, Any] | None = None,
        cycles_per_step: int = 1,
    ) -> None:
        signal = None if callable(reward) else _signal(reward)
        arguments = EnvArguments(scenario, _assignments(set), action, list(observe), signal, requirement, cycles_per_step)
        self._native: _native.Env | None = _native.Env(arguments)
        if callable(reward) and requirement is not None:
            raise ValueError("give a reward or a requirement, not both")
        self._reward = reward if callable(reward) else None
        self._owner = (os.getpid(), threading.get_ident())
        self._random = np.random.default_rng(self._native.seed)
        self._seed: int | None = None
        low, high = self._native.bounds
        self._kind: Action = action
        self._shape = (len(low),)
        self.action_space = box(np.array(low), np.array(high), self._shape)
        self.observation_space = box(-np.inf, np.inf, (len(observe),))
        #: Time from one cycle to the next, s.
        self.period_s = self._native.period_s

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begins an episode. The same seed gives the same episode.

        Without a seed, the first episode has the scenario's and each later one a new one, drawn after the last given seed.
        options: {"set": {...}}, values of the scenario for this episode. The same seed and options as before begin at once.
        """
        native = self._checked()
        if unknown := sorted(frozenset(options or {}) - {"set"}):
            raise ValueError(f"unknown options: {unknown}; use 'set'")
        if seed is not None:
            if seed < 0:
                raise ValueError(f"the seed is {seed}; use 0 or more")
            self._random = np.random.default_rng(seed)
            if _Env is not object:
                super().reset(seed=seed)
            self._seed = seed
        else:
            self._seed = native.seed if self._seed is None else int(self._random.integers(2**32))
        observed = native.reset(self._seed, _assignments((options or {}).get("set")))
        return np.frombuffer(observed).copy(), {"seed": self._seed}

    def step(self, action: ArrayLike) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Plays the cycles of a step. info has the events of the step, a line each, where there are any.

        Ctrl-C ends a step between two cycles; then the environment wants a reset. An exception of the reward is raised again
        after the step was played.
        """
        native = self._checked()
        numbers = _numbers(action, self._shape, self._kind)
        if (over := native.over) is not None:
            raise EnvStateError(f"{over}; call reset first")
        observed, reward, terminated, truncated, events = native.step(numbers)
        observation = np.frombuffer(observed).copy()
        info: dict[str, Any] = {"events": events} if events else {}
        if self._reward is not None:
            reward = float(self._reward(observation, info))
        return observation, reward, terminated, truncated, info

    @property
    def demand(self) -> _native.Demand | None:
        """What a pose law would get in this cycle: desired and estimated pose, and the desired one when the command is reached.

        None once the jaw does not move."""
        return self._checked().demand()

    def snapshot(self) -> _native.Snapshot:
        """This instant, to go back to again and again."""
        return self._checked().snapshot()

    def restore(self, snapshot: _native.Snapshot) -> Array:
        """Goes to an instant of an episode of this environment with the same seed and options; returns its observation."""
        native = self._checked()
        native.restore(snapshot)
        return np.frombuffer(native.observed()).copy()

    def close(self) -> None:
        """Lets the rig go."""
        if self._native is not None:
            self._checked()
        self._native = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _checked(self) -> _native.Env:
        if self._native is None:
            raise EnvStateError("the environment is closed; make another one")
        if self._owner != (os.getpid(), threading.get_ident()):
            raise EnvStateError("the environment was made in another process or thread; make one here")
        return self._native


class VectorEnv(_VectorEnv):  # type: ignore[misc]
    """Environments of one scenario side by side, on threads that run without the interpreter's lock.

    The arguments are those of Env; a reward is the name of a signal, or none. threads: by default as many as there are cores.
    After its end an episode begins again in the next step, which ignores the action and has the reward 0 (gymnasium's
    NEXT_STEP), with a seed of its own.
    """

    metadata: dict[str, Any] = {"autoreset_mode": _NEXT_STEP}
    render_mode = None

    def __init__(
        self,
        num_envs: int,
        scenario: str | PathLike[str] | None = None,
        *,
        action: Action = "targets",
        observe: Sequence[str] = OBSERVED,
        reward: str | None = None,
        requirement: str | None = None,
        set: Mapping[str, Any] | None = None,
        cycles_per_step: int = 1,
        threads: int | None = None,
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs is {num_envs}; use 1 or more")
        arguments = EnvArguments(scenario, _assignments(set), action, list(observe), _signal(reward), requirement, cycles_per_step)
        one = _native.Env(arguments)
        cores = len(os.sched_getaffinity(0))
        self._native: _native.VectorEnv | None = _native.VectorEnv(
            arguments, num_envs, min(num_envs, threads or cores, cores)
        )
        self._owner = (os.getpid(), threading.get_ident())
        self._first_seed = one.seed
        low, high = one.bounds
        self.num_envs = num_envs
        self.single_action_space = box(np.array(low), np.array(high), (len(low),))
        self.single_observation_space = box(-np.inf, np.inf, (len(observe),))
        self._kind: Action = action
        self._shape = (num_envs, len(low))
        self.action_space = box(np.tile(low, (num_envs, 1)), np.tile(high, (num_envs, 1)), self._shape)
        self.observation_space = box(-np.inf, np.inf, (num_envs, len(observe)))
        self._is_begun = False

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begins an episode in each environment; the first one has the seed, each other one the next.

        Without a seed, it is the scenario's each time."""
        native = self._checked()
        if options:
            raise ValueError("a vector of environments has no options; give 'set' when it is made")
        observed = native.reset(self._first_seed if seed is None else seed)
        self._is_begun = True
        return self._rows(observed), {}

    def step(self, actions: ArrayLike) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Plays a step in each environment. info has the events of each, where there are any."""
        native = self._checked()
        if not self._is_begun:
            raise EnvStateError("the environments were not reset; call reset first")
        numbers = _numbers(actions, self._shape, self._kind)
        try:
            observed, rewards, terminated, truncated, events = native.step(numbers, self._shape[1])
        except BaseException:
            self._is_begun = False
            raise
        info: dict[str, Any] = {"events": events} if any(events) else {}
        return self._rows(observed), np.frombuffer(rewards).copy(), np.array(terminated), np.array(truncated), info

    def close(self, **_: Any) -> None:
        """Ends the threads."""
        if self._native is not None:
            self._checked()
        self._native = None

    def _rows(self, observed: bytes) -> Array:
        return np.frombuffer(observed).reshape(self.num_envs, -1).copy()

    def _checked(self) -> _native.VectorEnv:
        if self._native is None:
            raise EnvStateError("the environments are closed; make others")
        if self._owner != (os.getpid(), threading.get_ident()):
            raise EnvStateError("the environments were made in another process or thread; make some here")
        return self._native
