"""Times the whole rig beside MuJoCo's mechanism alone: 10 s of chewing in steps of 125 µs, in turn, each in one thread.

    python tests/foreign/beside_mujoco.py target/release/masseter --rounds 5

The rig is `masseter test` with an empty scenario: virtual time without a recording. Timed is the whole process: its start, the
check of the motion, 11.4 s of boot, motion and stop, analysis and verdict. That contains the controller with forward kinematics,
the master, two buses with all frames, six drives, and the mechanism with friction.

MuJoCo has the mechanism of `rigid_bodies.py` with the bodies of that scenario. Timed are 80,000 steps, the 10 s of motion alone,
without the making of the model. It has no friction, controller, drive, bus or analysis; neither side has contact. `rollout`
makes all steps in one call from C. Servos of MuJoCo hold the six axes on the recorded motion of the rig.

The integrator is Euler, and constraint islands are off: the fastest set-up of those tried. `implicitfast`, which MuJoCo's
documentation advises, takes a tenth more. The solver is Newton, the default, with MuJoCo's own tolerance; CG and PGS take more.

MuJoCo must follow the true poses of the rig. The exit code is 1 if it does not, or if the rig takes longer than MuJoCo.
The CPU time counts, since other programs disturb it least.
"""

import argparse
import csv
import resource
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout

from rigid_bodies import DEFAULTS, Mechanism, turns

MOTION_S, SAMPLES_PER_S, STEPS_PER_SAMPLE = 10, 1000, 8
STEP_S = 1 / (SAMPLES_PER_S * STEPS_PER_SAMPLE)
STIFFNESS_N_PER_M, DAMPING_N_S_PER_M = 1e6, 2e3
PLACE_LIMIT_M, TURN_LIMIT_RAD = 50e-6, 0.5e-3
MOST_RATIO = 1.0
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


class Rig:
    """The default scenario under virtual time."""

    def __init__(self, masseter, folder):
        self.masseter, self.folder = masseter, folder
        self.scenario = folder / "chewing.toml"
        self.scenario.write_text("")

    def record(self):
        """The bodies, and the samples of the motion: true poses, positions and velocities of the axes."""
        run, tables = self.folder / "run", self.folder / "tables"
        self.command("run", self.scenario, "--clock", "virtual", "--quiet", "--out", run)
        self.command("export", run, "--format", "csv", "--table", "truth", "--out", tables)
        dynamics = tomllib.loads((run / "scenario.toml").read_text())["dynamics"]
        assert dynamics["step_ns"] == round(STEP_S * 1e9), dynamics["step_ns"]
        with open(tables / "truth.csv") as file:
            rows = [row for row in csv.DictReader(file) if 0 <= round(float(row["time_s"]), 6) <= MOTION_S]
        assert len(rows) == MOTION_S * SAMPLES_PER_S + 1, len(rows)
        columns = lambda name, count: np.array([[float(row[f"{name}_{i}"]) for i in range(count)] for row in rows])
        poses = np.c_[columns("position_m", 3), columns("quaternion_wxyz", 4)]
        return {key: dynamics[key] for key in DEFAULTS}, poses, columns("joint_m", 6), columns("joint_m_s", 6)

    def time_s(self):
        """CPU time of a run without a recording."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        self.command("test", self.scenario)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def command(self, *arguments):
        subprocess.run([self.masseter, *arguments], cwd=self.folder, check=True, stdout=subprocess.DEVNULL)


class Peer:
    """MuJoCo's mechanism, with a servo at each axis."""

    def __init__(self, bodies, poses, positions, velocities):
        self.mechanism, self.poses = Mechanism(bodies), poses
        self.model, self.data = self.mechanism.model, self.mechanism.data
        defaults = mujoco.MjModel.from_xml_string("<mujoco/>").opt
        option = self.model.opt
        option.timestep, option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_EULER
        option.iterations, option.tolerance = defaults.iterations, defaults.tolerance
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
        # A motor's force becomes what it is sent, less stiffness times position and damping times velocity.
        self.model.actuator_biastype[:] = mujoco.mjtBias.mjBIAS_AFFINE
        self.model.actuator_biasprm[:, 1:3] = -STIFFNESS_N_PER_M, -DAMPING_N_S_PER_M
        samples = np.arange(len(poses)) * STEPS_PER_SAMPLE
        steps = np.arange(1, samples[-1] + 1)
        between = lambda values: np.column_stack([np.interp(steps, samples, column) for column in values.T])
        self.sent = STIFFNESS_N_PER_M * between(positions) + DAMPING_N_S_PER_M * between(velocities)
        self.mechanism.put(poses[0])
        self.start = np.zeros(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, self.start, STATE)
        self.states = np.zeros((1, len(steps), len(self.start)))

    def time_s(self):
        """CPU time of the steps of the motion."""
        before = time.process_time()
        rollout.rollout(self.model, self.data, self.start, self.sent, state=self.states)
        return time.process_time() - before

    def away(self):
        """The largest distance and angle from the true poses of the rig in the last round."""
        platform = 1 + self.mechanism.platform  # The time comes first.
        poses = self.states[0, STEPS_PER_SAMPLE - 1 :: STEPS_PER_SAMPLE, platform : platform + 7]
        metres = np.linalg.norm(poses[:, :3] - self.poses[1:, :3], axis=1).max()
        return metres, turns(poses[:, 3:], self.poses[1:, 3:])


def spread(values, places):
    return f"{np.median(values):.{places}f} ({min(values):.{places}f}–{max(values):.{places}f})"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("masseter", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    masseter = arguments.masseter.resolve()
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(masseter, Path(folder))
        peer = Peer(*rig.record())
        rounds = [(rig.time_s(), peer.time_s()) for _ in range(arguments.rounds)]
    metres, radians = peer.away()
    ours, theirs = zip(*rounds)
    ratios = [our / their for our, their in rounds]
    print(f"CPU time of {MOTION_S} s of motion, median (least–most) of {len(rounds)} rounds in turn, s")
    print(f"  the whole rig            {spread(ours, 3)}")
    print(f"  MuJoCo's mechanism alone {spread(theirs, 3)}")
    print(f"MuJoCo stays within {metres * 1e6:.0f} µm and {radians * 1e3:.2f} mrad of the rig's true poses")
    if not (metres <= PLACE_LIMIT_M and radians <= TURN_LIMIT_RAD):
        sys.exit(f"MuJoCo leaves the motion: {PLACE_LIMIT_M * 1e6:g} µm and {TURN_LIMIT_RAD * 1e3:g} mrad are allowed")
    result = f"the whole rig takes {spread(ratios, 2)} times as long as MuJoCo's mechanism alone"
    if not np.median(ratios) <= MOST_RATIO:
        sys.exit(f"{result}, at most {MOST_RATIO:g} is allowed")
    version = subprocess.check_output([masseter, "--version"], text=True).strip()
    print(f"{result} ({version}, MuJoCo {mujoco.__version__})")


main()
