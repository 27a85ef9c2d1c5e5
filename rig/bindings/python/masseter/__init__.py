"""Kinematics, recordings and controllers of the Masseter rig.

    fk, ik, Mechanism     forward and inverse kinematics over arrays
    load                  a run folder as NumPy arrays
    run                   a run of the rig, with a controller of the rig or of yours
    control, Session      your controller in a run that somebody else has started

Lengths are in m, angles in rad, times in s unless a name says otherwise; poses are those of the platform in the base frame.
"""

from masseter._native import Demand, MasseterError, Pose, __version__
from masseter.controller import Parameter, Session, Signal, control
from masseter.kinematics import Mechanism, fk, ik
from masseter.recording import Run, load
from masseter.rig import Result, run

__all__ = [
    "Demand",
    "MasseterError",
    "Mechanism",
    "Parameter",
    "Pose",
    "Result",
    "Run",
    "Session",
    "Signal",
    "__version__",
    "control",
    "fk",
    "ik",
    "load",
    "run",
]
