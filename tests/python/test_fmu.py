"""FMUs as controllers: the same bytes as the law in Python, maps that do not fit, and FMUs that misbehave."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmus
import numpy as np
import pytest
from conftest import stands_but_for_time

import masseter
from masseter.fmu import _parts, _quaternion

GAIN, RISE = 0.2, 5e-6
#: The FMU's steps begin with the first pose that the rig asks for, in this cycle.
EVENT_S = 0.5
BAD_AFTER_S = 0.6

MAP = f"""
[inputs]
desired_z = {{ value = "desired.z", unit = "m" }}
estimated_z = {{ value = "estimated.z", unit = "m" }}
ahead_z = {{ value = "ahead.z", unit = "m" }}

[outputs]
z = {{ value = "pose.z", unit = "m" }}
error = "signal.error"

[start]
gain = {{ parameter = "gain", value = {GAIN}, range = [0.0, 1.0] }}
rise = {RISE}
event_s = {EVENT_S}
"""

SIGNALS = [masseter.Signal("error")]
PARAMETERS = [masseter.Parameter("gain", GAIN, (0.0, 1.0))]
FMUS = [f"{maker}{fmi}" for maker in ("c", "python") for fmi in (2, 3)]


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Builds each FMU once."""
    folder = tmp_path_factory.mktemp("fmus")
    built: dict[str, Path] = {}

    def build(name: str) -> Path:
        if name not in built:
            make = fmus.in_c if name.startswith("c") else fmus.by_generator
            built[name] = make(folder, int(name[-1]))
        return built[name]

    return build


@pytest.fixture(autouse=True)
def unpacked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Where FMUs are unpacked. The rig finds this Python."""
    folder = tmp_path / "unpacked"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    return folder


def play(path: Path, text: str = MAP, *arguments: str, **named: Any) -> masseter.Result:
    map_path = path.parent / f"{threading.get_ident()}.toml"
    map_path.write_text(text)
    words = ["--map", str(map_path), *arguments]
    return masseter.run(controller=f"fmu:{path}", arguments=words, duration=1, **named)


def refused(path: Path, text: str = MAP, *arguments: str) -> str:
    with pytest.raises(masseter.MasseterError) as error:
        play(path, text, *arguments)
    return str(error.value)


def changed(*lines: str) -> str:
    """The map with lines replaced by those of the same name, or added to the last table."""
    names = [line.split(" ")[0] for line in lines]
    return "\n".join([*(line for line in MAP.splitlines() if line.split(" ")[0] not in names or line.startswith("[")), *lines])


def law(event_cycle: int) -> Callable[[masseter.Demand], masseter.Pose]:
    """The FMUs' law in Python, with the event in this cycle from the first."""
    first, integral, estimated_z = 0, 0.0, 0.0

    def law(demand: masseter.Demand) -> masseter.Pose:
        nonlocal first, integral, estimated_z
        first = first or demand.cycle
        estimated_z = demand.estimated.position_m[2] if demand.estimated else estimated_z
        error = demand.desired.position_m[2] - estimated_z
        demand.signals["error"] = error
        integral += error
        x, y, ahead_z = demand.ahead.position_m
        z = ahead_z + demand.parameters["gain"] * error + 0.001 * integral
        if demand.cycle - first >= event_cycle:
            z += RISE
        return masseter.Pose((x, y, z), demand.ahead.quaternion_wxyz)

    return law


def digest_of_python(event_cycle: int, *arguments: str) -> str:
    words = ["--duration", "1", *arguments]
    result = masseter.run(controller=law(event_cycle), signals=SIGNALS, parameters=PARAMETERS, arguments=words)
    assert result.passed, result.messages
    digest: str = result.figures["digest"]
    return digest


@pytest.mark.parametrize("name", FMUS)
def test_an_fmu_gives_the_bytes_of_the_same_law_in_python(
    fmu: Callable[[str], Path], name: str, unpacked: Path, digests: list[str]
) -> None:
    result = play(fmu(name))
    assert result.passed, result.messages
    # One cycle earlier or later is another event.
    assert [result.figures["digest"] == digest for digest in digests] == [False, True, False]
    assert list(unpacked.iterdir()) == []


@pytest.fixture(scope="module")
def digests() -> list[str]:
    """Of the law in Python with the event a cycle early, in time, and a cycle late."""
    return [digest_of_python(round(1e3 * EVENT_S) + late) for late in (-1, 0, 1)]


def begin_of_event(path: Path, step: str, event_s: float) -> int:
    """The cycle in which the command begins to differ from that without the event."""
    with_event, without = (
        play(path, step + changed(f"event_s = {at_s}")).load().command for at_s in (event_s, 100.0)
    )
    same = min(len(with_event), len(without))
    differs = (with_event["target_m"][:same] != without["target_m"][:same]).any(axis=1)
    return int(with_event["cycle"][differs.argmax()])


def test_an_event_between_two_steps_of_a_cycle_is_of_this_cycle(fmu: Callable[[str], Path]) -> None:
    whole = begin_of_event(fmu("c2"), "", 0.5)
    half = "step_ms = 0.5\n"
    assert begin_of_event(fmu("c2"), half, 0.5) == whole
    assert begin_of_event(fmu("c2"), half, 0.4995) == whole - 1


def test_parameters_come_from_the_scenario_and_change_in_the_run(fmu: Callable[[str], Path], tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    stimulus = '[[stimulus]]\nparameter = "gain"\nvalue = 0.1\nat_s = 0.5\n'
    scenario.write_text("[parameters]\ngain = 0.3\n" + stimulus)
    python = masseter.run(
        scenario, law(500), signals=SIGNALS, parameters=PARAMETERS, arguments=["--duration", "1"]
    )
    result = play(fmu("c3"), MAP, scenario=scenario)
    assert result.passed and result.figures["digest"] == python.figures["digest"]
    assert list(result.load().parameter["gain"]) == [0.3, 0.1]

    scenario.write_text(stimulus.replace('"gain"', '"rise"').replace("0.1", "0.0"))
    fixed = 'bad_after_s = { parameter = "rise", value = 1.0, range = [0.0, 1.0] }'
    with_fixed = play(fmu("c2"), changed(fixed), scenario=scenario)
    assert with_fixed.verdict == "SAFE STOP", with_fixed.messages
    assert "'bad_after_s' is fixed: set 'rise' before the run" in with_fixed.messages


def test_units_of_the_map_and_of_the_fmu_are_converted(fmu: Callable[[str], Path], tmp_path: Path) -> None:
    # Every length is in mm, and so is what the law adds.
    text = MAP.replace('unit = "m"', 'unit = "mm"').replace(f"rise = {RISE}", f"rise = {1e3 * RISE}")
    result, in_m = play(fmu("c2"), text), play(fmu("c2"))
    assert result.passed, result.messages
    targets = [run.command["target_m"] for run in (result.load(), in_m.load())]
    assert abs(targets[0] - targets[1]).max() < 1e-12
    # The same unit by the FMU's description alone, which the map must not contradict.
    binary = {"linux64/law.so": fmus.library(tmp_path, 2)}
    described = fmus.pack(tmp_path / "mm.fmu", fmus.description(2, unit="mm"), binary)
    result = play(described, text.replace('"pose.z", unit = "mm"', '"pose.z"'))
    assert result.passed and result.figures["signals"][0]["unit"] == "mm", result.messages
    assert abs(result.load().command["target_m"] - targets[1]).max() < 1e-12
    assert "the map says 'm', the FMU 'mm': mend the one that is wrong" in refused(described)


def test_a_rotation_vector_is_the_rotation_of_the_quaternion() -> None:
    random = np.random.default_rng(1)
    for quaternion in [*random.normal(size=(100, 4)), np.array([1.0, 0, 0, 0]), np.array([1.0, 1e-9, 0, 0])]:
        quaternion /= np.linalg.norm(quaternion)
        parts = _parts(masseter.Pose([0.0, 0.0, 0.0], quaternion.tolist()))
        again = np.array(_quaternion([parts[name] for name in ("rx", "ry", "rz")]))
        # Both signs are one rotation.
        assert abs(again * np.sign(quaternion[0]) - quaternion).max() < 1e-15


MISBEHAVES = f"bad_after_s = {BAD_AFTER_S}"


@pytest.mark.parametrize(
    ("name", "misbehaviour", "said"),
    [
        ("c2", 2, ["its output 'z' is nan at 0.601 s of the FMU"]),
        ("c2", 3, ["fmi2DoStep returned 'error' at 0.6 s", "its log:", "error: solver: the matrix is singular (42)"]),
        ("c3", 3, ["fmi3DoStep returned 'error' at 0.6 s", "its log:", "error: solver: the matrix is singular"]),
        ("c3", 5, ["returned 'discard'", "try a smaller step_ms"]),
        ("c3", 6, ["it asked for the end of the simulation at 0.601 s"]),
    ],
)
def test_an_fmu_that_fails_stops_the_rig_safely_with_its_log(
    fmu: Callable[[str], Path], name: str, misbehaviour: int, said: list[str], unpacked: Path
) -> None:
    result = play(fmu(name), changed(MISBEHAVES, f"misbehaviour = {misbehaviour}"))
    assert (result.verdict, result.exit_code) == ("SAFE STOP", 5), result.messages
    assert "law_failed" in {event["cause"] for event in result.figures["events"]}
    assert all(text in result.messages for text in said), result.messages
    assert list(unpacked.iterdir()) == []


@pytest.mark.parametrize(
    ("misbehaviour", "arguments", "said"),
    [
        (1, [], ["SIGSEGV", "in doStep", "crashed in a call of the FMU", "gdb --args python3 -m masseter.fmu"]),
        (4, ["--patience", "500ms"], ["the controller", "was killed"]),
    ],
)
def test_an_fmu_that_crashes_or_hangs_ends_the_run_and_leaves_no_file(
    fmu: Callable[[str], Path], misbehaviour: int, arguments: list[str], said: list[str], unpacked: Path
) -> None:
    result = play(fmu("c2"), changed(MISBEHAVES, f"misbehaviour = {misbehaviour}"), *arguments)
    assert (result.verdict, result.exit_code) == ("DIED", 4), result.messages
    texts = result.messages + str(result)
    assert all(text in texts for text in said), texts
    assert list(unpacked.iterdir()) == []


def test_every_problem_of_a_map_is_listed_with_the_nearest_names(fmu: Callable[[str], Path], unpacked: Path) -> None:
    text = """
stepms = 1
[inputs]
desired_zz = "desired.z"
estimated_z = { value = "estimate.z", unit = "m" }
ahead_z = { value = "ahead.z", unit = "deg" }
z = "motion.time"
[outputs]
z = "pose.z"
error = { value = "pose.qw", unit = "" }
[start]
gian = 1.0
gain = "high"
misbehaviour = 0.5
rise = { parameter = "rise", value = 1.0 }
"""
    said = refused(fmu("c2"), text)
    problems = [
        "the key 'stepms' is unknown: nearest is step_ms",
        "inputs: the variable 'desired_zz' is unknown: nearest is desired_z",
        "inputs: 'estimated_z': the value 'estimate.z' is unknown: nearest is estimated.z",
        "inputs: 'ahead_z': 'deg' is no unit of this value: use m, cm, mm, um",
        "inputs: 'z' is no input of the FMU, but output",
        'outputs: \'z\': the FMU states no unit: give one, such as unit = "m" (m, cm, mm, um)',
        "outputs: the rotation needs all of pose.qw",
        "start: the variable 'gian' is unknown: nearest is gain",
        "start: 'gain' = 'high': the FMU's variable is of type Real",
        "start: 'misbehaviour' = 0.5: the FMU's variable is of type Integer",
        'start: \'rise\': write a value, or { parameter = "NAME"',
    ]
    assert [problem for problem in problems if problem not in said] == [], said
    assert "before it was ready" in said and list(unpacked.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("step_ms = 0.3\n" + MAP, "a step of 0.3 ms does not divide the cycle of 1 ms: set step_ms = 0.333333"),
        ("step_ms = 2\n" + MAP, "a step of 2 ms does not divide the cycle of 1 ms: set step_ms = 1 in the map"),
        ("step_ms = 0\n" + MAP, "step_ms = 0: give a number of milliseconds above 0"),
        (MAP.replace('"pose.z", unit = "m"', '"signal.z"'), "outputs: none is part of the pose"),
        (MAP.replace('"signal.error"', '{ value = "pose.z", unit = "m" }'), "outputs: 'pose.z' has more than one output"),
        (MAP + 'bad_after_s = "soon"', "start: 'bad_after_s' = 'soon': the FMU's variable is of type Real"),
        ("[inputs", "cannot be read"),
    ],
)
def test_a_map_that_cannot_be_played_is_refused(fmu: Callable[[str], Path], text: str, said: str) -> None:
    assert said in refused(fmu("c2"), text)


def test_an_fmu_that_cannot_run_here_is_refused_with_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = fmus.library(tmp_path, 2)
    text = tmp_path / "text.fmu"
    text.write_text("no archive")
    cases = {
        "for_windows": (fmus.description(2), {"win64/law.dll": library}, "no binaries/linux64/law.so, but binaries for win64: export it for linux64"),
        "empty": (fmus.description(2), {}, "no binaries/linux64/law.so, but binaries for no platform"),
        "newer": (fmus.description(3, version="4.0"), {}, "is of FMI '4.0': export it for FMI 2.0 or 3.0"),
        "exchange": (fmus.description(2, interface="ModelExchange"), {}, "is for model exchange alone: export it for co-simulation"),
        "half": (fmus.description(3), {"x86_64-linux/law.so": library}, "it cannot be loaded"),
    }
    for name, (xml, binaries, said) in cases.items():
        assert said in refused(fmus.pack(tmp_path / f"{name}.fmu", xml, binaries))
    assert "is no FMU" in refused(text)
    assert "is no file: give the path of an FMU" in refused(tmp_path / "missing.fmu")
    (tmp_path / "fmpy.py").write_text("raise ImportError('not here')")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    assert 'pip install "masseter[fmi]"' in refused(text)


def test_a_file_with_complaints_is_played_with_warnings(fmu: Callable[[str], Path]) -> None:
    result = play(fmu("python2"))
    assert result.passed and "warning: " in result.messages and "InitialUnknowns" in result.messages, result.messages


def test_a_map_is_only_for_an_fmu(fmu: Callable[[str], Path], tmp_path: Path) -> None:
    with pytest.raises(masseter.MasseterError, match="--map is for --controller fmu:FILE.fmu"):
        masseter.run(controller="hold", arguments=["--map", "map.toml"])
    # Without --map, the map is beside the FMU, whatever the folder is named.
    folder = tmp_path / "Kiefer ü 2"
    folder.mkdir()
    path = folder / "meine Regelung.fmu"
    path.write_bytes(fmu("c3").read_bytes())
    path.with_suffix(".toml").write_text(MAP)
    assert masseter.run(controller=f"fmu:{path}", arguments=["--duration", "1"]).passed


@pytest.mark.parametrize("name", ["c2", "python3"])
def test_an_fmu_controls_in_real_time(fmu: Callable[[str], Path], name: str) -> None:
    result = play(fmu(name), clock="rt")
    assert stands_but_for_time(result), str(result)


def test_the_signals_of_an_fmu_are_listed_before_a_run(
    fmu: Callable[[str], Path], masseter_command: str, unpacked: Path, tmp_path: Path
) -> None:
    path = tmp_path / "law.fmu"
    path.write_bytes(fmu("c2").read_bytes())
    path.with_suffix(".toml").write_text(MAP)
    other = tmp_path / "other map.toml"
    other.write_text(MAP.replace("signal.error", "signal.miss"))
    for words, name in ([], "error"), (["--map", str(other)], "miss"):
        listed = subprocess.run(
            [masseter_command, "signals", "--controller", f"fmu:{path}", *words], stdout=subprocess.PIPE, text=True, timeout=60, check=True
        ).stdout
        own = [line.split()[0] for line in listed.splitlines() if line.startswith(("signal.", "parameter.gain"))]
        assert own == [f"signal.{name}", "parameter.gain"]
    assert list(unpacked.iterdir()) == []


def test_two_rigs_play_the_same_fmu_at_once(fmu: Callable[[str], Path], unpacked: Path) -> None:
    path = fmu("python3")
    results: list[masseter.Result] = []
    threads = [threading.Thread(target=lambda: results.append(play(path))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [result.verdict for result in results] == ["PASS", "PASS"]
    assert results[0].figures["digest"] == results[1].figures["digest"]
    assert list(unpacked.iterdir()) == []
