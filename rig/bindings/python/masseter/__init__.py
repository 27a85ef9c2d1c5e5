"""Kinematics, recordings and controllers of the Masseter rig.

    fk, ik, Mechanism     forward and inverse kinematics over arrays
    load                  a run folder as NumPy arrays
    run                   a run of the rig, with a controller of the rig or of yours
    RobotModel            motion, Jacobian and inverse dynamics of a scenario
    control, Session      your controller in a run that somebody else has started
    Env, VectorEnv        the rig as an environment that steps, also for gymnasium

Lengths are in m, angles in rad, times in s unless a name says otherwise; poses are those of the platform in the base frame.
"""

from typing import TYPE_CHECKING, Any

from masseter._native import (
    Demand,
    ExternalForce,
    MasseterError,
    Motion,
    Pose,
    RobotModel,
    Times,
    __version__,
)
from masseter.controller import Cycle, Parameter, Session, Signal, control
from masseter.kinematics import Mechanism, fk, ik
from masseter.recording import Run, load
from masseter.rig import Result, run

if TYPE_CHECKING:
    from masseter.env import ActionError, Env, EnvStateError, VectorEnv

__all__ = [
    "ActionError",
    "Cycle",
    "Demand",
    "Env",
    "EnvStateError",
    "ExternalForce",
    "MasseterError",
    "Mechanism",
    "Motion",
    "Parameter",
    "Pose",
    "Result",
    "RobotModel",
    "Run",
    "Session",
    "Signal",
    "Times",
    "VectorEnv",
    "__version__",
    "control",
    "fk",
    "ik",
    "load",
    "run",
]


def __getattr__(name: str) -> Any:
    # gymnasium, where it is installed, takes longer to import than all else here.
    if name in {"ActionError", "Env", "EnvStateError", "VectorEnv"}:
        from masseter import env

        return getattr(env, name)
    raise AttributeError(f"module 'masseter' has no attribute '{name}'")
