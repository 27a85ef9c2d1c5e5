"""The rig as an environment that steps: what it plays is a run's; what it refuses, it names."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import masseter
import masseter.env
from masseter.messages import ControllerState

RUNNING = ControllerState.RUNNING
JOINTS = [f"{axis}.position" for axis in ("d1", "d2", "d3", "l1", "l2", "l3")]
SHORT: dict[str, Any] = {"duration_s": 0.3}


def played(env: masseter.Env, steps: int) -> list[bytes]:
    """The observations of steps in which the jaw is asked to stay."""
    stay = env.restore(env.snapshot())[:6] * 1e-3
    return [env.step(stay)[0].tobytes() for _ in range(steps)]


def stays(env: masseter.Env) -> tuple[float, ...]:
    demand = env.demand
    assert demand is not None
    return (*demand.ahead.position_m, *demand.ahead.quaternion_wxyz)


def recorded(topic: np.ndarray[Any, Any], begun: int, cycles: int) -> np.ndarray[Any, Any]:
    """The messages of so many cycles from one on."""
    return topic[(topic["cycle"] >= begun) & (topic["cycle"] < begun + cycles)]


@pytest.mark.parametrize("faults", ["", "[[faults]]\nkind = 'encoder_noise'\naxis = 'l1'\nsize = '20 um'\nat_s = 0.05\n"])
def test_the_targets_of_a_run_give_its_readings_to_the_bit(tmp_path: Path, faults: str) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(f"duration_s = 0.3\nseed = 5\n{faults}")
    run = masseter.run(scenario, clock="virtual").load()
    # The first command that follows the controller's word that the motion runs.
    begun = int(run.state["cycle"][run.state["controller_state"] == RUNNING][0]) + 1
    cycles = 295
    with masseter.Env(scenario, observe=JOINTS) as env:
        observation, info = env.reset()
        assert info["seed"] == 5
        shown = [observation]
        for command in recorded(run.command, begun, cycles):
            observation, _, terminated, truncated, _ = env.step(command["target_m"])
            assert not terminated and not truncated
            shown.append(observation)
    of_run = recorded(run.reading, begun, cycles + 1)["position_m"]
    # The signals are in mm: the same conversion as the judge's.
    assert np.array_equal(np.array(shown), of_run / 1e-3)


def test_a_pose_law_acts_as_in_a_run(tmp_path: Path) -> None:
    def law(demand: masseter.Demand) -> masseter.Pose:
        x, y, z = demand.ahead.position_m
        if demand.estimated is not None and demand.controller_state == RUNNING:
            z += 0.1 * (demand.desired.position_m[2] - demand.estimated.position_m[2])
        return masseter.Pose([x, y, z], demand.ahead.quaternion_wxyz)

    run = masseter.run(controller=law, duration=0.3, seed=3).load()
    begun = int(run.state["cycle"][run.state["controller_state"] == RUNNING][0]) + 1
    of_run = recorded(run.reading, begun, 290)["position_m"]
    env = masseter.Env(action="pose", observe=JOINTS, set=SHORT)
    observation, _ = env.reset(seed=3)
    for row in of_run:
        assert np.array_equal(observation, row / 1e-3)
        assert env.demand is not None
        pose = law(env.demand)
        observation, *_ = env.step([*pose.position_m, *pose.quaternion_wxyz])


def test_an_episode_is_truncated_by_its_end_and_terminated_by_a_safe_stop() -> None:
    env = masseter.Env(action="pose", set={"duration_s": 0.1})
    env.reset()
    steps, truncated, terminated = 0, False, False
    info: dict[str, Any] = {}
    while not (truncated or terminated):
        _, _, terminated, truncated, info = env.step(stays(env))
        steps += 1
    assert truncated and not terminated and 90 <= steps <= 105
    assert any("controller" in line for line in info["events"])
    with pytest.raises(masseter.EnvStateError, match="the motion is over; call reset first"):
        env.step([0, 0, 0, 1, 0, 0, 0])
    env.reset()
    *_, terminated, truncated, info = env.step([0, 0, 1, 1, 0, 0, 0])
    assert terminated and not truncated and info["events"]


def test_faults_and_stimuli_act(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(
        "duration_s = 1.0\n[[faults]]\nkind = 'encoder_stuck'\naxis = 'l3'\nat_s = 0.2\n[[stimulus]]\nat_s = 0.1\n"
        "parameter = 'motion_rate'\nvalue = 0.5\n"
    )
    env = masseter.Env(scenario, action="pose", observe=["parameter.motion_rate"])
    observation, _ = env.reset()
    assert observation == 1.0
    events, terminated = [], False
    while not terminated:
        observation, _, terminated, truncated, info = env.step(stays(env))
        events += info.get("events", [])
        assert not truncated
    assert observation == 0.5
    assert any("l3" in line for line in events), events


def test_the_same_seed_gives_the_same_episode() -> None:
    env = masseter.Env(set=SHORT)
    env.reset(seed=1)
    first = played(env, 30)
    env.reset(seed=1)
    assert played(env, 30) == first
    other = masseter.Env(set=SHORT)
    other.reset(seed=1)
    assert played(other, 30) == first
    _, info = env.reset()
    drawn = info["seed"]
    env.reset(seed=1)
    assert env.reset()[1]["seed"] == drawn
    assert env.reset()[1]["seed"] != drawn


def test_options_change_the_scenario_of_an_episode() -> None:
    env = masseter.Env(set=SHORT, observe=["d1.force"])
    env.reset(seed=1)
    before = played_pose(env)
    env.reset(seed=1, options={"set": {"dynamics.friction.guide_coefficient": 0.2}})
    assert played_pose(env) != before
    env.reset(seed=1)
    assert played_pose(env) == before
    with pytest.raises(ValueError, match="unknown options"):
        env.reset(options={"sett": {}})


def played_pose(env: masseter.Env) -> list[bytes]:
    demand = env.demand
    assert demand is not None
    targets = masseter.ik(demand.ahead.position_m, demand.ahead.quaternion_wxyz)
    return [env.step(targets)[0].tobytes() for _ in range(20)]


def test_a_snapshot_goes_on_as_it_went_on() -> None:
    env = masseter.Env(action="pose", set=SHORT, requirement=None, reward="-incisal.error")
    env.reset()

    def go(steps: int) -> list[tuple[bytes, float]]:
        shown = []
        for _ in range(steps):
            observation, reward, *_ = env.step(stays(env))
            shown.append((observation.tobytes(), reward))
        return shown

    go(50)
    branch = env.snapshot()
    went_on = go(60)
    for _ in range(2):
        env.restore(branch)
        assert go(60) == went_on
    other = masseter.Env(action="pose", set=SHORT)
    other.reset()
    with pytest.raises(masseter.MasseterError, match="another environment"):
        other.restore(branch)
    env.reset(seed=77)
    with pytest.raises(masseter.MasseterError, match="seed 77"):
        env.restore(branch)


def test_a_requirement_is_the_reward(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text("duration_s = 0.3\n[[require]]\nname = 'follows'\nsignal = 'incisal.error'\nmax = '0.5 mm'\n")

    def ahead(demand: masseter.Demand) -> masseter.Pose:
        return demand.ahead

    env = masseter.Env(scenario, action="pose", requirement="follows", observe=["incisal.error"])
    env.reset()
    rewards = []
    over = False
    while not over:
        _, reward, terminated, truncated, _ = env.step(stays(env))
        over = terminated or truncated
        rewards.append(reward)
    assert all(later <= earlier for earlier, later in zip(rewards, rewards[1:], strict=False))
    of_run = masseter.run(scenario, ahead).figures["requirements"][0]
    assert of_run["worst_at_s"] < 0.3, "the worst moment lies within the episode"
    assert rewards[-1] == of_run["margin"]
    with pytest.raises(masseter.MasseterError, match="no requirement 'folows'; did you mean 'follows'"):
        masseter.Env(scenario, requirement="folows")
    with pytest.raises(ValueError, match="not both"):
        masseter.Env(scenario, reward="incisal.error", requirement="follows")


def test_several_cycles_make_a_step() -> None:
    one = masseter.Env(set=SHORT, observe=JOINTS, reward="-l1.force")
    ten = masseter.Env(set=SHORT, observe=JOINTS, reward="-l1.force", cycles_per_step=10)
    stay = one.reset()[0] * 1e-3
    ten.reset()
    steps = [one.step(stay) for _ in range(10)]
    observation, reward, *_ = ten.step(stay)
    assert np.array_equal(observation, steps[-1][0])
    assert reward == pytest.approx(np.mean([step[1] for step in steps]), abs=1e-12)


def test_wrong_actions_are_refused_and_nothing_is_played() -> None:
    env = masseter.Env(set=SHORT)
    stay = env.reset()[0][:6] * 1e-3
    with pytest.raises(masseter.ActionError, match=r"the action has the shape \(5,\), not \(6,\)"):
        env.step(stay[:5])
    with pytest.raises(masseter.ActionError, match="number 2 of the action is nan"):
        env.step([0, 0, np.nan, 0.27, 0.27, 0.27])
    other = masseter.Env(set=SHORT)
    other.reset()
    assert np.array_equal(env.step(stay)[0], other.step(stay)[0])
    pose = masseter.Env(action="pose", set=SHORT)
    pose.reset()
    with pytest.raises(masseter.ActionError, match="the quaternion of the action has the length 0"):
        pose.step([0] * 7)
    assert pose.step(stays(pose))[2:4] == (False, False)


def test_wrong_names_are_refused_with_the_nearest_one() -> None:
    with pytest.raises(masseter.MasseterError, match="did you mean 'incisal.error'"):
        masseter.Env(observe=["incisal.eror"])
    with pytest.raises(masseter.MasseterError, match="did you mean 'incisal.error'"):
        masseter.Env(reward="-incisal.eror")
    with pytest.raises(masseter.MasseterError, match="use targets, pose or forces"):
        masseter.Env(action="torques")  # type: ignore[arg-type]
    with pytest.raises(masseter.MasseterError, match="60B2h"):
        masseter.Env(action="forces")
    with pytest.raises(masseter.MasseterError, match="rate_hz"):
        masseter.Env(set={"rate_hz": -1})


def test_forces_are_fed_forward(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text("rate_hz = 500\nduration_s = 0.3\n[[drive_profile]]\npdos.rpdo1 = ['6040h', '607Ah', '60B2h']\n")
    env = masseter.Env(scenario, action="forces", observe=["l1.true_position"])
    lifted = []
    for force_n in (0.0, 20.0):
        env.reset(seed=1)
        for _ in range(5):
            observation, _, terminated, *_ = env.step([0, 0, 0, force_n, force_n, force_n])
            if terminated:
                break
        lifted.append(observation[0])
    assert lifted[1] > lifted[0]


def test_forces_that_begin_at_once_move_the_legs_beyond_the_following_limit(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text("rate_hz = 500\nduration_s = 0.3\n[[drive_profile]]\npdos.rpdo1 = ['6040h', '607Ah', '60B2h']\n")

    def play(force_n: float, ramp: int = 1, **limits: float) -> tuple[bool, str]:
        env = masseter.Env(scenario, action="forces", observe=["l1.position"], set={f"can.{key}": value for key, value in limits.items()})
        env.reset(seed=1)
        events: list[str] = []
        for cycle in range(80):
            force = force_n * min(1.0, (cycle + 1) / ramp)
            _, _, terminated, _, info = env.step([0, 0, 0, force, force, force])
            events += info.get("events", [])
            if terminated:
                return True, events[0]
        return False, ""

    is_stopped, reason = play(20.0)
    assert is_stopped and "following_error" in reason, reason
    for held in (play(10.0), play(20.0, ramp=50), play(20.0, following_limit_m=5e-4)):
        assert held == (False, "")


def test_calls_at_the_wrong_time_are_refused() -> None:
    env = masseter.Env(set=SHORT)
    with pytest.raises(masseter.EnvStateError, match="was not reset; call reset first"):
        env.step([0] * 6)
    stay = env.reset()[0][:6] * 1e-3

    refused = []

    def from_another_thread() -> None:
        try:
            env.step(stay)
        except masseter.EnvStateError as error:
            refused.append(str(error))

    thread = threading.Thread(target=from_another_thread)
    thread.start()
    thread.join()
    assert refused and "made in another process or thread" in refused[0]

    child = os.fork()
    if child == 0:
        try:
            env.step(stay)
        except masseter.EnvStateError:
            os._exit(7)
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    env.step(stay)
    env.close()
    with pytest.raises(masseter.EnvStateError, match="closed"):
        env.step(stay)


def test_an_exception_of_a_reward_is_raised_again_and_the_episode_goes_on() -> None:
    def reward(observation: Any, info: dict[str, Any]) -> float:
        if is_broken:
            raise ZeroDivisionError("no reward")
        return float(observation[0])

    is_broken = True
    env = masseter.Env(set=SHORT, reward=reward)
    stay = env.reset()[0][:6] * 1e-3
    with pytest.raises(ZeroDivisionError, match="no reward"):
        env.step(stay)
    is_broken = False
    observation, value, *_ = env.step(stay)
    assert value == observation[0]


@contextmanager
def interrupted_soon() -> Iterator[None]:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    try:
        with pytest.raises(KeyboardInterrupt):
            yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def test_ctrl_c_ends_a_step_between_two_cycles() -> None:
    # A motion without a way: the jaw may stay.
    still = {"duration_s": 100.0, "parameters.motion_amplitude": 0}
    env = masseter.Env(set=still, cycles_per_step=99_000)
    stay = env.reset()[0][:6] * 1e-3
    with interrupted_soon():
        env.step(stay)
    with pytest.raises(masseter.EnvStateError, match="left in the middle; call reset first"):
        env.step(stay)
    env.reset()
    vector = masseter.VectorEnv(2, set=still, cycles_per_step=99_000)
    vector.reset()
    with interrupted_soon():
        vector.step([stay, stay])
    with pytest.raises(masseter.EnvStateError, match="not reset"):
        vector.step([stay, stay])
    vector.reset()


def test_a_vector_plays_what_single_environments_play() -> None:
    number, steps = 3, 12
    vector = masseter.VectorEnv(number, set={"duration_s": 0.1}, cycles_per_step=10, reward="-incisal.error", threads=2)
    observations, _ = vector.reset(seed=4)
    singles = [masseter.Env(set={"duration_s": 0.1}, cycles_per_step=10, reward="-incisal.error") for _ in range(number)]
    begun = [single.reset(seed=4 + place)[0] for place, single in enumerate(singles)]
    assert np.array_equal(observations, begun)
    stay = observations[:, :6] * 1e-3
    over = [False] * number
    for _ in range(steps):
        observations, rewards, terminated, truncated, _ = vector.step(stay)
        for place, single in enumerate(singles):
            if over[place]:
                expected: tuple[Any, ...] = (single.reset(seed=4 + place + number)[0], 0.0, False, False)
            else:
                expected = single.step(stay[place])[:4]
            over[place] = expected[2] or expected[3]
            assert np.array_equal(observations[place], expected[0])
            assert (rewards[place], terminated[place], truncated[place]) == expected[1:]
    with pytest.raises(masseter.ActionError, match=r"the shape \(3, 5\), not \(3, 6\)"):
        vector.step(stay[:, :5])
    vector.close()
    with pytest.raises(masseter.EnvStateError, match="closed"):
        vector.step(stay)


def test_gymnasium_accepts_it() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    actions: tuple[masseter.env.Action, ...] = ("targets", "pose")
    for action in actions:
        env = masseter.Env(action=action, set=SHORT, reward="-incisal.error")
        assert isinstance(env, gymnasium.Env)
        check_env(env, skip_render_check=True)
    assert isinstance(masseter.VectorEnv(1, set=SHORT), gymnasium.vector.VectorEnv)


def test_without_gymnasium_the_spaces_are_small_boxes() -> None:
    from masseter._spaces import Box

    space = Box(np.zeros(6), np.ones(6), (6,))
    assert space.contains(space.sample()) and space.sample() in space
    assert not space.contains(np.full(6, 2.0)) and not space.contains(np.zeros(5))
    assert Box(-np.inf, np.inf, (3,)).contains(Box(-np.inf, np.inf, (3,)).sample())


def test_a_vector_refuses_rewards_that_it_cannot_ask_and_other_threads() -> None:
    with pytest.raises(TypeError, match="the reward is a function; give the name of a signal"):
        masseter.VectorEnv(2, reward=lambda observation, info: 0.0)  # type: ignore[arg-type]
    vector = masseter.VectorEnv(2, set=SHORT)
    vector.reset()
    raised: list[BaseException] = []

    def elsewhere() -> None:
        for call in (lambda: vector.step(np.zeros((2, 6))), vector.close):
            try:
                call()
            except masseter.EnvStateError as error:
                raised.append(error)

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert len(raised) == 2
    vector.close()
