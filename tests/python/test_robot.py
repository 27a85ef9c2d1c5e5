"""The robot of a scenario, what a session says of it, and what a law knows of a cycle."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import masseter
from masseter.messages import ControllerState

STILL = [0.0] * 6


def test_the_robot_and_the_arrays_have_the_same_kinematics() -> None:
    robot = masseter.RobotModel()
    for time_s in (0.0, 1.3, 5.0):
        pose = robot.motion(time_s).pose
        position_m = robot.inverse_kinematics(pose)
        assert np.allclose(position_m, masseter.ik(pose.position_m, pose.quaternion_wxyz), rtol=0, atol=1e-15)
        assert robot.forward_kinematics(position_m).position_m == pytest.approx(pose.position_m, abs=1e-12)


def test_jacobian_and_twist_give_the_speeds_of_the_axes() -> None:
    robot, step_s = masseter.RobotModel(), 1e-4
    before, here, after = (robot.motion(1.0 + later_s) for later_s in (-step_s, 0.0, step_s))
    moved_m = np.subtract(robot.inverse_kinematics(after.pose), robot.inverse_kinematics(before.pose))
    assert np.allclose(np.array(robot.jacobian(here.pose)) @ here.twist, moved_m / (2 * step_s), atol=1e-5)
    assert np.linalg.norm(here.twist) > 1e-3


def test_a_force_downwards_is_carried_by_the_legs() -> None:
    robot = masseter.RobotModel()
    pose = robot.motion(0.0).pose
    weight_n = robot.inverse_dynamics(pose, STILL, STILL)
    loaded_n = robot.inverse_dynamics(pose, STILL, STILL, [0, 0, -30, 0, 0, 0])
    carried = np.array(robot.jacobian(pose)).T @ np.subtract(loaded_n, weight_n)
    assert carried == pytest.approx([0, 0, 30, 0, 0, 0], abs=1e-9)


def test_the_way_to_the_motion_ends_at_its_first_pose(tmp_path: Path) -> None:
    scenario = tmp_path / "slow.toml"
    scenario.write_text("duration_s = 3.0\n[controller]\nease_s = 4.0\n")
    robot = masseter.RobotModel(scenario)
    assert (robot.times.duration_s, robot.times.ease_s, robot.times.period_s) == (3.0, 4.0, 1e-3)
    first = robot.motion(0.0).pose
    start = masseter.Pose([0.001, 0.0, 0.28], [1.0, 0.0, 0.0, 0.0])
    assert robot.easing(start, 0.0).pose == start
    assert robot.easing(start, 4.0).pose.position_m == pytest.approx(first.position_m, abs=1e-15)
    assert robot.easing(start, 2.0).motion_time_s < 0.0 <= robot.motion(0.0).motion_time_s


def test_a_question_without_an_answer_raises_with_the_reason() -> None:
    robot = masseter.RobotModel()
    nowhere = masseter.Pose([math.nan, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0])
    asked: list[tuple[Callable[[], object], str]] = [
        (lambda: robot.motion(math.inf), "no finite number"),
        (lambda: robot.inverse_kinematics(masseter.Pose([0, 0, 0.27], [0.5, 0, 0, 0])), "length 0.5, not 1"),
        (lambda: robot.jacobian(nowhere), "no finite number"),
        (lambda: robot.forward_kinematics([0, 0, 0, 0.3, 0.3, 0.2]), "assemble"),
    ]
    for ask, reason in asked:
        with pytest.raises(masseter.MasseterError, match=reason):
            ask()
    with pytest.raises(masseter.MasseterError, match="nowhere.toml"):
        masseter.RobotModel("nowhere.toml")


FORCES = """
duration_s = 1.0
[load_cell]
[force_estimate]
"""


def test_a_law_knows_what_the_drives_the_load_cell_and_the_estimate_say(tmp_path: Path) -> None:
    scenario = tmp_path / "forces.toml"
    scenario.write_text(FORCES)
    demands: list[masseter.Demand] = []

    def law(demand: masseter.Demand) -> masseter.Pose:
        demands.append(demand)
        return demand.ahead

    run = masseter.run(scenario, controller=law).load()
    readings = {int(reading["cycle"]): reading for reading in run.reading}
    for demand in demands:
        reading = readings[demand.cycle]
        assert demand.position_m == list(reading["position_m"]) and demand.force_n == list(reading["force_n"])
        assert demand.load_cell_n == reading["load_cell_n"]
    assert demands[0].external is None
    external = demands[-1].external
    assert external is not None and external.uncertainty_n > 0.0 and len(external.force_n) == 3
    # The twist is what the desired pose does from one cycle to the next.
    played = [demand for demand in demands if demand.controller_state == ControllerState.RUNNING]
    for before, demand, after in zip(played[:-2], played[1:-1], played[2:], strict=True):
        moved_m = np.subtract(after.desired.position_m, before.desired.position_m)
        assert demand.desired_twist[:3] == pytest.approx(moved_m / 2e-3, abs=2e-5)
    assert max(abs(demand.desired_twist[2]) for demand in played) > 1e-3


def test_without_a_load_cell_and_an_estimate_a_law_sees_none() -> None:
    seen = set()

    def law(demand: masseter.Demand) -> masseter.Pose:
        seen.add((demand.load_cell_n, demand.external))
        return demand.ahead

    masseter.run(controller=law, duration=1)
    assert seen == {(None, None)}
