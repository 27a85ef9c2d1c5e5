"""Compares the rig's rigid-body dynamics with MuJoCo.

MuJoCo has its own model of the mechanism: three open legs and a platform, closed by its own Jacobians. Random bodies and
motions go as files to the rig's code, which a hidden test of the plant runs. Its answers are judged here. The printed table is
that of docs/dynamics.md; a quantity or a limit that differs from the document is an error.

    python tests/foreign/rigid_bodies.py cargo test -p masseter-plant --lib -- --ignored answers_a_reference
"""

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np

LEGS = range(3)
AZIMUTHS = np.radians([0, 120, 240])
CENTRES = np.c_[np.cos(AZIMUTHS), np.sin(AZIMUTHS), 0 * AZIMUTHS] * 0.1 / np.sqrt(3)
ALONG = np.c_[-np.sin(AZIMUTHS), np.cos(AZIMUTHS), 0 * AZIMUTHS]
INWARD = -np.c_[np.cos(AZIMUTHS), np.sin(AZIMUTHS), 0 * AZIMUTHS]
CORNERS = np.c_[np.cos(AZIMUTHS), np.sin(AZIMUTHS), 0 * AZIMUTHS] * 0.05 / np.sqrt(3)
UP = np.array([0.0, 0.0, 1.0])
NEUTRAL_M = np.array([0.0, 0.0, 0.27])
FORCE_STEP_S, FORWARD_S = 1e-3, 0.5
DOCUMENT = Path(__file__).parents[2] / "docs/dynamics.md"
DEFAULTS = {
    "carriage_mass_kg": 0.7,
    "cylinder_mass_kg": 0.5,
    "cylinder_centre_m": 0.09,
    "cylinder_inertia_kg_m2": 1.35e-3,
    "rod_mass_kg": 0.4,
    "rod_centre_m": 0.1,
    "rod_inertia_kg_m2": 1.33333e-3,
    "platform_mass_kg": 0.5,
    "platform_centre_m": [0.0, 0.0, 0.0],
    "platform_inertia_kg_m2": [2e-4, 2e-4, 3.5e-4, 0.0, 0.0, 0.0],
}


def words(values):
    return " ".join(f"{value:.17g}" for value in np.atleast_1d(values))


def model(bodies):
    """The mechanism in MuJoCo's language. A leg's x axis is its own, its y axis is the slide."""

    def link(mass, place, inertia):
        return (
            f'<inertial pos="{words([place, 0, 0])}" mass="{words(mass)}" '
            f'diaginertia="{words([inertia / 13, inertia, inertia])}"/>'
        )

    def leg(i):
        return f"""
        <body name="carriage{i}" pos="{words(CENTRES[i])}" xyaxes="{words(INWARD[i])} {words(ALONG[i])}">
          <inertial pos="0 0 0" mass="{words(bodies["carriage_mass_kg"])}" diaginertia="1e-3 1e-3 1e-3"/>
          <joint name="d{i}" type="slide" axis="0 1 0"/>
          <body name="cylinder{i}">
            {link(bodies["cylinder_mass_kg"], bodies["cylinder_centre_m"], bodies["cylinder_inertia_kg_m2"])}
            <joint name="theta{i}" type="hinge" axis="0 1 0"/>
            <body name="rod{i}">
              {link(bodies["rod_mass_kg"], -bodies["rod_centre_m"], bodies["rod_inertia_kg_m2"])}
              <joint name="l{i}" type="slide" axis="1 0 0"/>
              <site name="ball{i}"/>
            </body>
          </body>
        </body>"""

    corners = "".join(f'<site name="corner{i}" pos="{words(CORNERS[i])}"/>' for i in LEGS)
    return f"""
    <mujoco>
      <compiler angle="radian"/>
      <option timestep="2.5e-5" integrator="RK4" gravity="0 0 -9.81" iterations="200" tolerance="1e-14">
        <flag contact="disable"/>
      </option>
      <default><equality solref="0.0002 1" solimp="0.9999 0.9999 0.001"/></default>
      <worldbody>{"".join(leg(i) for i in LEGS)}
        <body name="platform"><freejoint name="platform"/>
          <inertial pos="{words(bodies["platform_centre_m"])}" mass="{words(bodies["platform_mass_kg"])}"
            fullinertia="{words(bodies["platform_inertia_kg_m2"])}"/>{corners}
        </body>
      </worldbody>
      <equality>{"".join(f'<connect site1="ball{i}" site2="corner{i}"/>' for i in LEGS)}</equality>
      <actuator>{"".join(f'<motor joint="{axis}{i}"/>' for axis in "dl" for i in LEGS)}</actuator>
    </mujoco>"""


class Mechanism:
    """MuJoCo's mechanism of some bodies."""

    def __init__(self, bodies):
        self.model = mujoco.MjModel.from_xml_string(model(bodies))
        self.data = mujoco.MjData(self.model)
        joint = lambda name: self.model.joint(name)
        self.place = {f"{q}{i}": joint(f"{q}{i}").qposadr[0] for q in ("d", "theta", "l") for i in LEGS}
        self.dof = {f"{q}{i}": joint(f"{q}{i}").dofadr[0] for q in ("d", "theta", "l") for i in LEGS}
        self.platform, self.platform_dof = joint("platform").qposadr[0], joint("platform").dofadr[0]
        self.legs_dofs = [self.dof[f"{q}{i}"] for i in LEGS for q in ("d", "theta", "l")]
        self.platform_dofs = list(range(self.platform_dof, self.platform_dof + 6))
        self.axes = [self.dof[f"{q}{i}"] for q in "dl" for i in LEGS]

    def put(self, pose):
        """Puts the platform there, and the legs where they reach it."""
        data = self.data
        data.qpos[self.platform : self.platform + 7] = pose
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, pose[3:])
        self.rotation = rotation.reshape(3, 3)
        for i in LEGS:
            reach = pose[:3] + self.rotation @ CORNERS[i] - CENTRES[i]
            inward, height = reach @ INWARD[i], reach[2]
            data.qpos[self.place[f"d{i}"]] = reach @ ALONG[i]
            data.qpos[self.place[f"l{i}"]] = np.hypot(inward, height)
            data.qpos[self.place[f"theta{i}"]] = np.arctan2(height, inward)

    def move(self, twist, acceleration):
        """Moves the platform so (base axes), and the legs with it, by MuJoCo's Jacobians of the balls and corners."""
        data, turn = self.data, self.rotation.T
        data.qvel[self.platform_dofs] = np.r_[twist[:3], turn @ twist[3:]]
        data.qacc[self.platform_dofs] = np.r_[acceleration[:3], turn @ acceleration[3:]]
        mujoco.mj_fwdPosition(self.model, data)
        balls, corners = self.jacobians()
        data.qvel[self.legs_dofs] = np.linalg.solve(balls, corners @ data.qvel[self.platform_dofs])
        mujoco.mj_fwdPosition(self.model, data)
        mujoco.mj_fwdVelocity(self.model, data)
        balls_dot, corners_dot = self.jacobians(rates=True)
        gain = corners @ data.qacc[self.platform_dofs] + corners_dot @ data.qvel[self.platform_dofs]
        data.qacc[self.legs_dofs] = np.linalg.solve(balls, gain - balls_dot @ data.qvel[self.legs_dofs])

    def jacobians(self, rates=False):
        """Of the three balls over the legs' joints, and of the three corners over the platform's; or their rates."""
        found = []
        for name, body, dofs in (("ball", "rod{}", self.legs_dofs), ("corner", "platform", self.platform_dofs)):
            rows = []
            for i in LEGS:
                linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
                site, owner = self.data.site(f"{name}{i}"), self.model.body(body.format(i)).id
                if rates:
                    mujoco.mj_jacDot(self.model, self.data, linear, angular, site.xpos, owner)
                else:
                    mujoco.mj_jacSite(self.model, self.data, linear, angular, self.model.site(f"{name}{i}").id)
                rows.append(linear[:, dofs])
            found.append(np.vstack(rows))
        return found

    def answer(self, motion):
        """Forces of the axes, energies, and the reactions of every leg in its own axes, of a motion."""
        pose, twist, acceleration, wrench = np.split(motion, [7, 13, 19])
        data = self.data
        data.xfrc_applied[:] = 0
        self.put(pose)
        self.move(twist, acceleration)
        data.eq_active[:] = 0
        mujoco.mj_inverse(self.model, data)
        mujoco.mj_energyPos(self.model, data)
        mujoco.mj_energyVel(self.model, data)
        balls, corners = self.jacobians()
        # Unknown: six forces of the axes, and nine of the balls on the platform.
        system = np.zeros((15, 15))
        for column, axis in enumerate(self.axes):
            system[self.legs_dofs.index(axis), column] = 1
        system[:9, 6:], system[9:, 6:] = -balls.T, corners.T
        applied = np.r_[wrench[:3], self.rotation.T @ wrench[3:]]
        needed = data.qfrc_inverse
        solved = np.linalg.solve(system, np.r_[needed[self.legs_dofs], needed[self.platform_dofs] - applied])
        forces, at_balls = solved[:6], solved[6:].reshape(3, 3)
        energy = data.energy[1], data.energy[0]
        return np.r_[forces, energy, self.reactions(at_balls)]

    def reactions(self, at_balls):
        """MuJoCo's forces between the bodies of each leg, with the balls' forces applied from outside."""
        data = self.data
        for i in LEGS:
            rod = self.model.body(f"rod{i}").id
            arm = data.site(f"ball{i}").xpos - data.xipos[rod]
            data.xfrc_applied[rod] = np.r_[-at_balls[i], np.cross(arm, -at_balls[i])]
        qacc = data.qacc.copy()
        mujoco.mj_rnePostConstraint(self.model, data)
        assert np.array_equal(qacc, data.qacc)
        found = []
        for i in LEGS:
            axes = np.vstack([ALONG[i], INWARD[i], UP])
            hinge = data.xpos[self.model.body(f"carriage{i}").id]
            found.append(axes @ at_balls[i])
            for name in ("rod", "cylinder", "carriage"):
                body = self.model.body(f"{name}{i}").id
                moment, force = np.split(data.cfrc_int[body], 2)
                centre = data.subtree_com[self.model.body_rootid[body]]
                found += [axes @ force, axes @ (moment + np.cross(centre - hinge, force))]
        return np.concatenate(found)

    def forward(self, motion, forces):
        """Poses at the end of each millisecond under forces that hold for it, and the largest gap at a ball."""
        pose, twist = motion[:7], motion[7:13]
        data = self.data
        data.xfrc_applied[:] = 0
        self.put(pose)
        self.move(twist, np.zeros(6))
        data.eq_active[:] = 1
        data.time, poses, gap = 0.0, [], 0.0
        for force in forces:
            data.ctrl[:] = force
            for _ in range(round(FORCE_STEP_S / self.model.opt.timestep)):
                mujoco.mj_step(self.model, data)
            mujoco.mj_kinematics(self.model, data)
            poses.append(data.qpos[self.platform : self.platform + 7].copy())
            sites = [(data.site(f"ball{i}").xpos, data.site(f"corner{i}").xpos) for i in LEGS]
            gap = max(gap, *(np.linalg.norm(ball - corner) for ball, corner in sites))
        return np.array(poses), gap


def random_bodies(rng):
    inertia = rng.uniform(1e-4, 6e-4, 3)
    inertia[2] = rng.uniform(abs(inertia[0] - inertia[1]), inertia[0] + inertia[1])
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    tensor = axes @ np.diag(inertia) @ axes.T
    return {
        "carriage_mass_kg": rng.uniform(0.3, 2.0),
        "cylinder_mass_kg": rng.uniform(0.2, 1.0),
        "cylinder_centre_m": rng.uniform(0.05, 0.12),
        "cylinder_inertia_kg_m2": rng.uniform(5e-4, 3e-3),
        "rod_mass_kg": rng.uniform(0.1, 0.8),
        "rod_centre_m": rng.uniform(0.05, 0.15),
        "rod_inertia_kg_m2": rng.uniform(5e-4, 3e-3),
        "platform_mass_kg": rng.uniform(0.2, 1.0),
        "platform_centre_m": rng.uniform(-0.02, 0.02, 3).tolist(),
        "platform_inertia_kg_m2": tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist(),
    }


def random_path(rng):
    """A smooth motion of the platform: pose, twist and acceleration at a time, from sums of two waves."""
    shares = rng.uniform(-1, 1, (2, 6)) * np.array([6e-3, 6e-3, 8e-3, 0.12, 0.12, 0.12])
    rates = 2 * np.pi * np.array([[1.43], [2.17]])
    phases = rng.uniform(0, 2 * np.pi, (2, 6))
    place = lambda time: NEUTRAL_M + (shares * np.sin(rates * time + phases)).sum(0)[:3]
    turn = lambda time: quaternion((shares * np.sin(rates * time + phases)).sum(0)[3:])

    def omega(time, h=1e-4):
        rate = (turn(time + h) - turn(time - h)) / (2 * h)
        product, inverse = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(inverse, turn(time))
        mujoco.mju_mulQuat(product, rate, inverse)
        return 2 * product[1:]

    def motion(time, h=1e-3):
        waves = rates * time + phases
        speed = (shares * rates * np.cos(waves)).sum(0)[:3]
        gain = (-shares * rates**2 * np.sin(waves)).sum(0)[:3]
        angular_gain = (omega(time + h) - omega(time - h)) / (2 * h)
        return np.r_[place(time), turn(time), speed, omega(time), gain, angular_gain]

    return motion


def quaternion(vector):
    angle = np.linalg.norm(vector)
    axis = vector / angle if angle > 0 else UP
    return np.r_[np.cos(angle / 2), axis * np.sin(angle / 2)]


def reference(path):
    """Motions and forces of a recorded chewing motion: poses, rates and accelerations of the joints."""
    with open(path) as file:
        rows = np.array([[float(value) for value in row] for row in list(csv.reader(file))[1:]])
    poses, rates, gains, forces = np.split(rows, [7, 13, 19], axis=1)
    mechanism, motions = Mechanism(DEFAULTS), []
    for pose, rate, gain in zip(poses, rates, gains):
        mechanism.put(pose)
        mujoco.mj_kinematics(mechanism.model, mechanism.data)
        corner = mechanism.rotation @ CORNERS.T
        hinges = [mechanism.model.body(f"carriage{i}").id for i in LEGS]
        legs = [mechanism.data.site(f"ball{i}").xpos - mechanism.data.xpos[hinges[i]] for i in LEGS]
        directions = np.vstack([ALONG, [leg / np.linalg.norm(leg) for leg in legs]])
        arms = np.vstack([corner.T, corner.T])
        jacobian = np.c_[directions, np.cross(arms, directions)]
        twist = np.linalg.solve(jacobian, rate)
        # Their change at a constant twist: a leg turns by the part of the corner's velocity across both slide and leg.
        omega = twist[3:]
        pull = np.cross(omega, np.cross(omega, arms))
        bias = (directions * pull).sum(1)
        for i, leg in enumerate(legs):
            across = np.cross(ALONG[i], directions[3 + i])
            speed = across @ (twist[:3] + np.cross(omega, corner.T[i]))
            bias[3 + i] += speed**2 / np.linalg.norm(leg)
        motions.append(np.r_[pose, twist, np.linalg.solve(jacobian, gain - bias), np.zeros(6)])
    return np.array(motions), forces


class Case:
    """Bodies with motions, and a start with forces for the way forward."""

    def __init__(self, folder, name, bodies, motions, start, forces):
        self.folder, self.motions, self.start, self.forces = folder / name, motions, start, forces
        self.mechanism = Mechanism(bodies)
        self.folder.mkdir()
        keys = "".join(f"{key} = {value}\n" for key, value in bodies.items())
        frictionless = "friction.model = 'none'\n"
        (self.folder / "dynamics.toml").write_text(f"[dynamics]\n{frictionless}{keys}")
        np.savetxt(self.folder / "motions.csv", motions, delimiter=",", fmt="%.17g")
        np.savetxt(self.folder / "start.csv", start[None], delimiter=",", fmt="%.17g")
        np.savetxt(self.folder / "forces.csv", forces, delimiter=",", fmt="%.17g")

    def answers(self):
        return (np.loadtxt(self.folder / name, delimiter=",", ndmin=2) for name in ("answers.csv", "path.csv"))


def random_case(folder, number, rng):
    bodies, path = random_bodies(rng) if number else DEFAULTS, random_path(rng)
    food = lambda: np.r_[rng.uniform(-30, 30, 3), rng.uniform(-1, 1, 3)]
    motions = np.array([np.r_[path(time), food()] for time in rng.uniform(0, 5, 50)])
    mechanism = Mechanism(bodies)
    steps = np.arange(0, FORWARD_S, FORCE_STEP_S)
    free = np.zeros(6)
    forces = np.array([mechanism.answer(np.r_[path(time + FORCE_STEP_S / 2), free])[:6] for time in steps])
    return Case(folder, f"bodies{number}", bodies, motions, path(0.0)[:13], forces)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def judge(rows):
    """Prints the table. Ends with an error if a row is above its limit, or the document has another limit."""
    documented = DOCUMENT.read_text().splitlines()
    print("| quantity | found | limit |\n| --- | --- | --- |")
    faults = []
    for what, found, limit, unit in rows:
        limited = f"{limit:g} {unit} |"
        print(f"| {what} | {found:.1g} {unit} | {limited}")
        if not found <= limit:
            faults.append(f"{what}: {found} {unit} is more than {limited[:-2]}")
        if not any(line.startswith(f"| {what} |") and line.endswith(f"| {limited}") for line in documented):
            faults.append(f"{what}: {DOCUMENT.name} has no such row with the limit {limited[:-2]}")
    sys.exit("\n".join(faults) or 0)


def main(command):
    rng = np.random.default_rng(25)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recorded, recorded_n = reference(Path(__file__).with_name("reference_chewing.csv"))
        cases = [random_case(folder, number, rng) for number in range(11)]
        chewing = Case(folder, "chewing", DEFAULTS, recorded, cases[0].start, cases[0].forces)
        environment = {**os.environ, "MASSETER_REFERENCE": name}
        subprocess.run(command, env=environment, check=True, stdout=sys.stderr)
        rows = compare(cases)
        off_n = next(chewing.answers())[:, :6] - recorded_n
    judge(
        [
            ("inverse dynamics, recorded chewing at 1.43 Hz: rms", rms(off_n), 0.005, "N"),
            ("inverse dynamics, recorded chewing at 1.43 Hz: greatest", np.abs(off_n).max(), 0.02, "N"),
            *rows,
        ]
    )


def compare(cases):
    forces, energies, loads, metres, radians, gaps = [], [], [], [], [], []
    for case in cases:
        ours, path = case.answers()
        theirs = np.array([case.mechanism.answer(motion) for motion in case.motions])
        forces.append(ours[:, :6] - theirs[:, :6])
        for column in (6, 7):
            change = (ours[:, column] - ours[0, column]) - (theirs[:, column] - theirs[0, column])
            energies.append(np.abs(change).max() / np.ptp(theirs[:, column]))
        loads += list(load_errors(ours[:, 8:], theirs[:, 8:]))
        poses, gap = case.mechanism.forward(case.start, case.forces)
        gaps.append(gap)
        metres.append(np.linalg.norm(path[:, :3] - poses[:, :3], axis=1).max())
        radians.append(turns(path[:, 3:], poses[:, 3:]))
    forces = np.concatenate(forces)
    return [
        ("inverse dynamics, 11 sets of bodies, 50 random motions each, with food: rms", rms(forces), 0.005, "N"),
        ("inverse dynamics, 11 sets of bodies, 50 random motions each, with food: greatest", np.abs(forces).max(), 0.02, "N"),
        ("kinetic and potential energy, changes between these motions", max(energies) * 100, 0.1, "%"),
        ("forces of ball, rod, hinge and guide", max(loads[0::2]) * 100, 0.5, "%"),
        ("moments of rod, hinge and guide", max(loads[1::2]) * 100, 0.5, "%"),
        ("forward dynamics, 0.5 s under given forces at 125 µs a step: place", max(metres) * 1e6, 10, "µm"),
        ("forward dynamics, 0.5 s under given forces at 125 µs a step: turn", max(radians) * 1e3, 0.05, "mrad"),
        ("MuJoCo's own gap at a ball meanwhile", max(gaps) * 1e6, 1, "µm"),
    ]


def load_errors(ours, theirs):
    """Errors of forces and of moments as shares of their own size."""
    places = np.arange(63).reshape(3, 21)
    force = np.concatenate([places[:, start : start + 3] for start in (0, 3, 9, 15)])
    moment = np.concatenate([places[:, start : start + 3] for start in (6, 12, 18)])
    for vectors in (force, moment):
        off = np.linalg.norm(ours[:, vectors] - theirs[:, vectors], axis=2)
        yield (off / np.linalg.norm(theirs[:, vectors], axis=2)).max()


def turns(ours, theirs):
    angles, product, inverse = [], np.zeros(4), np.zeros(4)
    for one, other in zip(ours, theirs):
        mujoco.mju_negQuat(inverse, other)
        mujoco.mju_mulQuat(product, one, inverse)
        angles.append(2 * np.linalg.norm(product[1:]))
    return max(angles)


if __name__ == "__main__":
    main(sys.argv[1:])
