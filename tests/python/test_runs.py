"""Runs from Python: laws, controllers of the drives, what they leave, and what goes wrong."""

import contextlib
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import stands_but_for_time

import masseter
from masseter.messages import Command, ControllerState, DriveRequest, DriveState, Event, State

SHORT = ["--duration", "1"]


def ahead(demand: masseter.Demand) -> masseter.Pose:
    return demand.ahead


def test_a_law_gives_the_same_digest_under_both_simulated_clocks_and_passes() -> None:
    results = [masseter.run(controller=ahead, clock=clock, arguments=SHORT) for clock in ("virtual", "lockstep")]
    assert [result.verdict for result in results] == ["PASS", "PASS"]
    assert results[0].figures["digest"] == results[1].figures["digest"]
    own = masseter.run(clock="virtual", arguments=SHORT)
    assert own.passed and own.figures["digest"] != results[0].figures["digest"]


def test_a_law_controls_in_real_time() -> None:
    result = masseter.run(controller=ahead, clock="rt", arguments=SHORT)
    assert stands_but_for_time(result), str(result)


def test_the_demand_is_what_the_state_message_reports() -> None:
    demands = []

    def law(demand: masseter.Demand) -> masseter.Pose:
        demands.append(demand)
        return demand.ahead

    run = masseter.run(controller=law, arguments=SHORT).load()
    states = {int(state["cycle"]): state for state in run.state}
    assert run.is_whole and len(demands) > 1000
    for demand in demands:
        state = states[demand.cycle]
        # Messages have nine decimal digits.
        assert demand.desired.position_m == pytest.approx(state["desired_position_m"], rel=1e-9)
        assert demand.estimated is not None
        assert demand.estimated.quaternion_wxyz == pytest.approx(state["estimated_quaternion_wxyz"], rel=1e-9)
        # A change of state comes after the law's turn.
        if demand.controller_state == state["controller_state"]:
            assert demand.motion_time_s == state["motion_time_s"]


def far(demand: masseter.Demand) -> masseter.Pose:
    x, y, z = demand.ahead.position_m
    return masseter.Pose([x, y + 0.01, z], demand.ahead.quaternion_wxyz)


def not_a_number(demand: masseter.Demand) -> masseter.Pose:
    return masseter.Pose([float("nan"), 0.0, 0.27], demand.ahead.quaternion_wxyz)


def no_rotation(demand: masseter.Demand) -> masseter.Pose:
    return masseter.Pose(demand.ahead.position_m, [0.5, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("wrong", "cause"), [(far, "velocity_limit"), (not_a_number, "law_failed"), (no_rotation, "law_failed")]
)
def test_a_wrong_pose_stops_the_rig_safely(wrong: Callable[[masseter.Demand], masseter.Pose], cause: str) -> None:
    def law(demand: masseter.Demand) -> masseter.Pose:
        return wrong(demand) if demand.motion_time_s > 0.3 else demand.ahead

    result = masseter.run(controller=law, arguments=SHORT)
    assert (result.verdict, result.exit_code) == ("SAFE STOP", 5)
    assert cause in {event["cause"] for event in result.figures["events"]}


def test_an_exception_of_the_law_stops_the_rig_safely_and_is_raised_again(tmp_path: Path) -> None:
    def law(demand: masseter.Demand) -> masseter.Pose:
        if demand.motion_time_s > 0.3:
            raise ZeroDivisionError("my law broke")
        return demand.ahead

    with pytest.raises(ZeroDivisionError, match="my law broke"):
        masseter.run(controller=law, arguments=SHORT, keep=tmp_path / "run")
    summary = masseter.load(tmp_path / "run").summary
    assert "law_failed" in {event["cause"] for event in summary["figures"]["events"]}

    with pytest.raises(masseter.MasseterError, match="returned no masseter.Pose"):
        masseter.run(controller=lambda demand: None, arguments=SHORT)  # type: ignore[arg-type, return-value]


def test_signals_and_parameters_are_recorded_by_their_names() -> None:
    seen = []

    def law(demand: masseter.Demand) -> masseter.Pose:
        seen.append(demand.parameters["gain"])
        demand.signals["height"] = 1e3 * demand.desired.position_m[2]
        return demand.ahead

    result = masseter.run(
        controller=law,
        arguments=[*SHORT, "--set", "gain=3"],
        signals=[masseter.Signal("height", "mm", "Height of the platform.")],
        parameters=[masseter.Parameter("gain", 1.0, (0.0, 10.0), "1/s")],
    )
    assert result.passed and set(seen) == {3.0}
    run = result.load()
    heights = {int(row["cycle"]): row["height"] for row in run.signal}
    played = run.state[run.state["motion_time_s"] > 0.1]
    # A late reading apart, the state has the desired pose that the law saw.
    assert np.allclose([heights[int(row["cycle"])] for row in played], 1e3 * played["desired_position_m"][:, 2])
    assert list(run.parameter["gain"]) == [3.0]
    assert run.to_polars("signal").columns == ["seq", "published_ns", "version", "cycle", "height"]
    assert result.figures["signals"][0]["unit"] == "mm"
    assert (result.folder / "report.html").read_text().count("Height of the platform.") == 1


def test_names_that_are_not_declared_are_refused() -> None:
    def law(demand: masseter.Demand) -> masseter.Pose:
        demand.signals["depth"] = 1.0
        return demand.ahead

    with pytest.raises(masseter.MasseterError, match="not declared: .*depth"):
        masseter.run(controller=law, arguments=SHORT)
    with pytest.raises(masseter.MasseterError, match="no name of a signal"):
        masseter.run(controller=ahead, signals=[masseter.Signal("Depth")])
    with pytest.raises(masseter.MasseterError, match="no parameter 'gain', but: motion_rate, motion_amplitude"):
        masseter.run(controller=ahead, arguments=[*SHORT, "--set", "gain=3"])


def start(command: str, name: str, *arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [command, "run", "--quiet", "--controller", "external", "--name", name, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def attached(name: str, rig: "subprocess.Popen[str]", own_motion: bool = False) -> masseter.Session:
    while True:
        try:
            return masseter.Session(name, own_motion=own_motion)
        except masseter.MasseterError:
            assert rig.poll() is None, rig.communicate()


# Cycles in which all drives boot.
PLAYED = 300


def play(session: masseter.Session, misbehave: Callable[[int, Command], None]) -> None:
    """Leaves the drives without voltage for some cycles; `misbehave` changes each command."""
    for _ in range(PLAYED):
        cycle = session.wait()
        assert cycle is not None
        reading_cycle = cycle.reading.cycle if cycle.reading else 0
        command = Command(cycle=cycle.number, reading_cycle=reading_cycle, request=DriveRequest.OFF)
        state = State(
            cycle=cycle.number, reading_cycle=reading_cycle, controller_state=ControllerState.WAIT_READINGS
        )
        misbehave(cycle.number, command)
        session.publish(command, state)


def rig_name(folder: Path) -> str:
    return f"session-{folder.name[-20:]}"


def plant_of(folder: Path) -> int:
    """The process of the plant in a run of this folder."""
    for arguments in Path("/proc").glob("[0-9]*/cmdline"):
        # A process may end meanwhile.
        with contextlib.suppress(OSError):
            words = arguments.read_bytes().split(b"\0")
            if b"plant" in words and rig_name(folder).encode() in words:
                return int(arguments.parent.name)
    raise AssertionError(f"no plant runs for {folder}")


def session_run(
    masseter_command: str,
    folder: Path,
    work: Callable[[masseter.Session], None],
    *more: str,
    own_motion: bool = False,
) -> tuple[int, str]:
    clock = more or ("--clock", "lockstep", "--patience", "1s")
    name = rig_name(folder)
    rig = start(masseter_command, name, "--duration", "1", "--out", str(folder / "run"), *clock)
    said = []

    def control() -> None:
        try:
            with attached(name, rig, own_motion) as session:
                work(session)
        except masseter.MasseterError as error:
            said.append(str(error))

    # A thread of its own: core and priority of a session in real time end with it.
    controlling = threading.Thread(target=control)
    controlling.start()
    output = rig.communicate(timeout=60)
    controlling.join()
    return rig.returncode, "".join([*output, *said])


def test_a_controller_of_the_drives_is_recorded(masseter_command: str, tmp_path: Path) -> None:
    def work(session: masseter.Session) -> None:
        assert session.period_s == 1e-3
        assert session.scenario["duration_s"] == session.robot.times.duration_s == 1.0
        play(session, lambda number, command: None)
        session.finish()

    code, said = session_run(masseter_command, tmp_path, work)
    run = masseter.load(tmp_path / "run")
    # The motion was never played, and the verdict says so.
    assert code == 1, said
    assert list(run.command["cycle"]) == list(range(1, PLAYED + 1))
    # The drives have booted, without voltage.
    assert np.all(run.reading["position_m"][-1, 3:] > 0.2)


@pytest.mark.parametrize(("own_motion", "declared"), [(False, "scenario"), (True, "own")])
def test_an_own_motion_is_declared_before_the_start(
    masseter_command: str, tmp_path: Path, own_motion: bool, declared: str
) -> None:
    def work(session: masseter.Session) -> None:
        play(session, lambda number, command: None)
        session.finish()

    code, said = session_run(masseter_command, tmp_path, work, own_motion=own_motion)
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["declared"]["motion"] == declared
    assert code == 1 and ("own motion of the controller" in said) == own_motion, said


#: Changes the command of a cycle, which is counted from the moment that all drives were enabled; says whether it is sent.
Misbehaviour = Callable[[int, Command], bool]


def hold(session: masseter.Session, misbehave: Misbehaviour, cycles: int = 150) -> None:
    """Enables the drives and holds them where they are, but for what `misbehave` does."""
    began, target_m = 0, [0.0] * 6
    while True:
        cycle = session.wait()
        assert cycle is not None and cycle.reading is not None
        if not began:
            target_m = list(cycle.reading.position_m)
            if all(state == DriveState.OPERATION_ENABLED for state in cycle.reading.drive_state):
                began = cycle.number
        command = Command(cycle=cycle.number, reading_cycle=cycle.reading.cycle, request=DriveRequest.ENABLE)
        command.target_m[:] = target_m
        held = cycle.number - began if began else 0
        if held > cycles:
            return
        if misbehave(held, command):
            # A program may ignore what the session tells it.
            with contextlib.suppress(masseter.MasseterError):
                session.publish(command, State(cycle=cycle.number, reading_cycle=cycle.reading.cycle))


def behave(held: int, command: Command) -> bool:
    return True


def stop_publishing(held: int, command: Command) -> bool:
    return held < 50


def repeat_a_cycle(held: int, command: Command) -> bool:
    command.cycle -= max(held - 50, 0)
    return True


def jump(axis: int, by_m: float) -> Misbehaviour:
    def misbehave(held: int, command: Command) -> bool:
        if held == 50:
            command.target_m[axis] += by_m
        return True

    return misbehave


def unknown_request(held: int, command: Command) -> bool:
    if held >= 50:
        command.request = 77
    return True


@pytest.mark.parametrize(
    ("misbehave", "cause", "axis", "value", "limit"),
    [
        (stop_publishing, "command_lost", None, 21.0, 20.0),
        (repeat_a_cycle, "command_lost", None, 21.0, 20.0),
        (jump(0, 5e-3), "velocity_limit", "d1", 5.0, 0.2),
        (jump(5, -5e-3), "velocity_limit", "l3", 5.0, 0.4),
        (jump(4, 1.5e-4), "acceleration_limit", "l2", 150.0, 100.0),
        (jump(3, 0.2), "stroke_limit", "l1", 0.49, 0.3),
        (jump(2, float("nan")), "bad_message", "d3", None, 0.0),
        (unknown_request, "bad_message", None, 77.0, 0.0),
    ],
)
def test_a_misbehaving_controller_is_stopped_by_the_master_which_names_axis_and_limit(
    masseter_command: str,
    tmp_path: Path,
    misbehave: Misbehaviour,
    cause: str,
    axis: str | None,
    value: float | None,
    limit: float,
) -> None:
    def work(session: masseter.Session) -> None:
        hold(session, misbehave)
        session.finish(is_safe_stop=True)

    code, said = session_run(masseter_command, tmp_path, work)
    assert code == 5, said
    run = masseter.load(tmp_path / "run")
    faults = [event for event in run.summary["figures"]["events"] if event["kind"] == "fault"]
    # Consequences are not reported.
    assert [(fault["source"], fault["cause"], fault.get("axis")) for fault in faults] == [("master", cause, axis)]
    assert faults[0]["value"] == (None if value is None else pytest.approx(value, rel=0.01)), faults
    assert faults[0]["limit"] == pytest.approx(limit, rel=0.01), faults
    assert run.reading["master_fault"][-1] == 1
    assert not np.any(run.reading["drive_state"][-1] == DriveState.OPERATION_ENABLED)


def test_a_controller_that_ends_with_powered_drives_has_them_stopped(masseter_command: str, tmp_path: Path) -> None:
    def work(session: masseter.Session) -> None:
        hold(session, behave)
        session.finish()

    code, said = session_run(masseter_command, tmp_path, work)
    run = masseter.load(tmp_path / "run")
    assert code == 5 and "the drives made a quick stop" in said, said
    assert run.reading["master_fault"][-1] == 0
    assert not np.any(run.reading["drive_state"][-1] == DriveState.OPERATION_ENABLED)


def test_a_controller_that_goes_on_without_commands_is_given_up(masseter_command: str, tmp_path: Path) -> None:
    def work(session: masseter.Session) -> None:
        play(session, lambda number, command: None)
        while not session.is_stop_requested:
            session.wait(timeout_s=0.01)

    code, said = session_run(masseter_command, tmp_path, work)
    assert code == 4 and "stopped sending commands" in said, said


def publish_twice(session: masseter.Session) -> None:
    session.wait()
    session.publish(Command(cycle=1), State(cycle=1))
    session.publish(Command(cycle=1), State(cycle=1))


def publish_of_an_earlier_cycle(session: masseter.Session) -> None:
    for _ in range(2):
        session.wait()
        session.publish(Command(cycle=1), State(cycle=1))


@pytest.mark.parametrize(
    ("work", "reason"),
    [
        (publish_twice, "cycle 1 has its command already"),
        (publish_of_an_earlier_cycle, "the command is of cycle 1, but cycle 2 has begun"),
    ],
)
def test_a_command_that_is_not_the_cycles_own_is_refused_and_the_run_ends_with_its_reason(
    masseter_command: str, tmp_path: Path, work: Callable[[masseter.Session], None], reason: str
) -> None:
    code, said = session_run(masseter_command, tmp_path, work)
    assert code == 4 and reason in said, said


def test_other_threads_run_while_a_session_waits(masseter_command: str, tmp_path: Path) -> None:
    begins = threading.Event()
    counted: list[int] = []

    def count(plant: int) -> None:
        begins.wait()
        counted.extend(range(1000))
        os.kill(plant, signal.SIGCONT)

    def work(session: masseter.Session) -> None:
        session.wait()
        plant = plant_of(tmp_path)
        os.kill(plant, signal.SIGSTOP)
        counting = threading.Thread(target=count, args=[plant])
        counting.start()
        begins.set()
        # The plant answers only after the other thread has counted.
        cycle = session.wait()
        counting.join()
        assert cycle is not None and cycle.reading is not None and len(counted) == 1000
        session.finish()

    code, said = session_run(masseter_command, tmp_path, work)
    assert code == 1, said


def test_a_controller_that_begins_late_is_waited_for(masseter_command: str, tmp_path: Path) -> None:
    def work(session: masseter.Session) -> None:
        time.sleep(0.5)
        play(session, lambda number, command: None)
        session.finish()

    code, said = session_run(masseter_command, tmp_path, work, "--clock", "rt")
    # No drive has moved: the master waits for the first command.
    causes = {event["cause"] for event in masseter.load(tmp_path / "run").summary["figures"]["events"]}
    assert code in (1, 3) and "command_lost" not in causes, said


def test_a_controller_that_hangs_in_real_time_is_given_up(masseter_command: str, tmp_path: Path) -> None:
    def hang(session: masseter.Session) -> None:
        play(session, lambda number, command: None)
        # The plant waits five seconds for a controller that has become silent.
        time.sleep(7.0)

    code, said = session_run(masseter_command, tmp_path, hang, "--clock", "rt")
    assert code == 4 and "stopped sending commands" in said, said


def test_a_flood_of_events_costs_the_flooder_alone(masseter_command: str, tmp_path: Path) -> None:
    def flood(session: masseter.Session) -> None:
        play(session, lambda number, command: None)
        for _ in range(20_000):
            session.publish_event(Event())
        play(session, lambda number, command: None)
        session.finish()

    code, said = session_run(masseter_command, tmp_path, flood)
    run = masseter.load(tmp_path / "run")
    topics = {topic["topic"]: topic for topic in run.summary["figures"]["topics"]}
    lost = {name: topic["missing"] for name, topic in topics.items()}
    # What the recorder could not take is counted, to the last one.
    assert code == 6 and lost["event"] > 0 and lost["reading"] == lost["command"] == 0, (said, lost)
    assert topics["event"]["messages"] + lost["event"] >= 20_000, topics
    assert len(run.command) == 2 * PLAYED


def test_a_controller_that_leaves_is_named(masseter_command: str, tmp_path: Path) -> None:
    code, said = session_run(masseter_command, tmp_path, lambda session: session.fail("no more ideas"))
    assert code == 4 and "no more ideas" in said, said


@pytest.mark.parametrize("timeout_s", [None, 0.0, 0.01])
def test_a_controller_that_waits_no_more_is_given_up_and_named(
    masseter_command: str, tmp_path: Path, timeout_s: float | None
) -> None:
    over = threading.Event()

    def hang(session: masseter.Session) -> None:
        begun = 0
        while begun < 50:
            begun += session.wait(timeout_s) is not None
        over.wait(4.0)

    code, said = session_run(masseter_command, tmp_path, hang)
    assert code == 4 and "the controller died: it did not answer in cycle 50 for 1.0 s" in said, said


@pytest.mark.parametrize("timeout_s", [None, 0.0, 0.01])
def test_a_plant_that_does_not_answer_is_given_up_by_a_controller_that_only_looks(
    masseter_command: str, tmp_path: Path, timeout_s: float | None
) -> None:
    def work(session: masseter.Session) -> None:
        for _ in range(50):
            session.wait()
        os.kill(plant_of(tmp_path), signal.SIGSTOP)
        while not session.is_stop_requested:
            session.wait(timeout_s)

    code, said = session_run(masseter_command, tmp_path, work)
    # A wait without a time-out has begun the next cycle.
    number = 51 if timeout_s is None else 50
    assert code == 4 and f"the plant died: it did not answer in cycle {number} for 2.0 s" in said, said


def test_without_a_rig_or_a_run_the_reason_is_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(masseter.MasseterError, match="no rig named 'nowhere' takes a controller"):
        masseter.control(ahead, "nowhere")
    with pytest.raises(masseter.MasseterError, match="nowhere does not exist: name the folder of a run"):
        masseter.load(tmp_path / "nowhere")
    with pytest.raises(masseter.MasseterError, match="nowhere.toml"):
        masseter.run("nowhere.toml")
    monkeypatch.delenv("MASSETER")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(masseter.MasseterError, match="not on the PATH"):
        masseter.run()


def test_tables_have_the_units_in_their_names() -> None:
    run = masseter.run(clock="virtual", arguments=SHORT).load()
    states = run.to_polars("state")
    assert states.height == len(run.state) and "desired_position_m_2" in states.columns
    assert list(run.to_pandas("state").columns) == states.columns


def test_a_recording_that_is_cut_short_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    result = masseter.run(clock="virtual", arguments=SHORT, keep=tmp_path / "run")
    recording = tmp_path / "run" / "recording.mcap"
    whole = len(result.load().state)
    recording.write_bytes(recording.read_bytes()[: recording.stat().st_size // 2])
    cut = masseter.load(tmp_path / "run")
    assert not cut.is_whole and 0 < len(cut.state) < whole
    recording.write_bytes(b"no recording")
    with pytest.raises(masseter.MasseterError, match="not readable as MCAP"):
        masseter.load(tmp_path / "run")


def test_a_run_is_loaded_by_its_folder_its_recording_or_a_link(tmp_path: Path) -> None:
    states = masseter.run(clock="virtual", arguments=SHORT, keep=tmp_path / "run").load().state
    (tmp_path / "latest").symlink_to("run")
    (tmp_path / "link.mcap").symlink_to("run/recording.mcap")
    for name in ("run/recording.mcap", "latest", "latest/recording.mcap", "link.mcap"):
        run = masseter.load(tmp_path / name)
        assert len(run.state) == len(states) and run.summary["verdict"]["word"] == "PASS", name
        assert run.folder.resolve() == (tmp_path / "run").resolve(), name
    (tmp_path / "run" / "recording.mcap").unlink()
    with pytest.raises(masseter.MasseterError, match="the run ended before its recorder wrote"):
        masseter.load(tmp_path / "run")


def test_a_result_is_short_as_text_and_a_notebook_sees_verdict_and_charts(tmp_path: Path) -> None:
    strict = tmp_path / "strict.toml"
    strict.write_text("[[require]]\nname = 'impossible & strict'\nsignal = 'incisal.error'\nduring = 'running'\nmax = '1 nm'\n")
    result = masseter.run(strict, clock="virtual", duration=1, seed=7, set={"rate_hz": 500})
    assert len(repr(result)) < 120 and "FAIL" in repr(result)
    assert str(result).startswith("FAIL: failed: impossible & strict\n  FAIL: impossible & strict: ") and "margin" in str(result)
    page = result._repr_html_()
    assert page.count("<svg") == 3 and "impossible &amp; strict" in page and len(page) < 100_000
    run = result.load()
    assert (run.scenario["seed"], run.scenario["rate_hz"]) == (7, 500)


def test_the_folder_of_a_run_that_nobody_keeps_goes_with_its_result(tmp_path: Path) -> None:
    result = masseter.run(clock="virtual", duration=1)
    folder = result.folder
    assert folder.is_dir()
    del result
    assert not folder.exists()
    assert masseter.run(clock="virtual", duration=1, keep=tmp_path / "kept").folder == tmp_path / "kept"
    assert (tmp_path / "kept" / "report.html").is_file()


def test_a_pose_is_compared_and_pickled() -> None:
    pose = masseter.Pose([0.0, 0.0, 0.27], [1.0, 0.0, 0.0, 0.0])
    assert pickle.loads(pickle.dumps(pose)) == pose
    assert pose != masseter.Pose([0.0, 0.0, 0.28], [1.0, 0.0, 0.0, 0.0])


def test_a_law_cannot_change_its_parameters() -> None:
    def law(demand: masseter.Demand) -> masseter.Pose:
        demand.parameters["gain"] = 99.0  # type: ignore[index]
        return demand.ahead

    with pytest.raises(TypeError, match="does not support item assignment"):
        masseter.run(controller=law, duration=1, parameters=[masseter.Parameter("gain", 1.0, (0.0, 10.0))])


def test_the_fixture_of_pytest_fails_with_verdict_requirement_margin_and_moment(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(
        "def test_passes(masseter):\n    assert masseter(duration=1).verdict == 'PASS'\n"
        "def test_fails(masseter):\n    masseter('strict.toml', duration=1)\n"
    )
    (tmp_path / "strict.toml").write_text(
        "[[require]]\nname = 'strict'\nsignal = 'incisal.error'\nduring = 'running'\nmax = '1 nm'\n"
    )
    said = subprocess.run([sys.executable, "-m", "pytest", "-q", "test_it.py"], cwd=tmp_path, stdout=subprocess.PIPE, text=True).stdout
    assert "1 failed, 1 passed" in said, said
    assert "FAIL: failed: strict" in said and "margin" in said and "report.html" in said, said


def test_a_program_gets_its_arguments_and_lengths_near_one_are_poses(tmp_path: Path) -> None:
    (tmp_path / "a law.py").write_text(
        "import sys, masseter\n"
        "assert sys.argv[1:] == ['--gain', '2 x'], sys.argv\n"
        "longer = lambda demand: masseter.Pose(demand.ahead.position_m, [1.0001 * part for part in demand.ahead.quaternion_wxyz])\n"
        "sys.exit(not masseter.control(longer))\n"
    )
    result = masseter.run(controller=f"{sys.executable} '{tmp_path}/a law.py' --gain '2 x'", duration=1)
    assert result.passed, result
    assert result.load().manifest["controller"].endswith("a law.py --gain 2 x")
