"""Builds the FMUs of the tests: one law in C and by two foreign generators."""

import subprocess
import sys
import zipfile
from pathlib import Path

SOURCES = Path(__file__).parent / "fmu"
PLATFORMS = {2: "linux64", 3: "x86_64-linux"}

#: The law's variables: name, value reference, causality, variability.
REALS = [
    *((name, number, "input", "continuous") for number, name in enumerate(["desired_z", "estimated_z", "ahead_z"])),
    *((name, number, "parameter", "tunable") for number, name in enumerate(["gain", "rise", "event_s"], start=3)),
    ("z", 6, "output", "continuous"),
    ("error", 7, "output", "continuous"),
    ("bad_after_s", 8, "parameter", "fixed"),
]


def description(fmi: int, version: str | None = None, unit: str = "", interface: str = "CoSimulation") -> str:
    """The model description of the law in C. The outputs have the unit."""
    rows = []
    for name, reference, causality, variability in REALS:
        at = f'name="{name}" valueReference="{reference}" causality="{causality}" variability="{variability}"'
        of = ('start="0"' if causality != "output" else "") + (f' unit="{unit}"' if unit and causality == "output" else "")
        rows.append(f"<ScalarVariable {at}><Real {of}/></ScalarVariable>" if fmi == 2 else f"<Float64 {at} {of}/>")
    at = 'name="misbehaviour" valueReference="100" causality="parameter" variability="fixed"'
    rows.append(f'<ScalarVariable {at}><Integer start="0"/></ScalarVariable>' if fmi == 2 else f'<Int32 {at} start="0"/>')
    token = "guid" if fmi == 2 else "instantiationToken"
    if fmi == 3:
        rows.insert(0, '<Float64 name="time" valueReference="200" causality="independent" variability="continuous"/>')
        structure = '<Output valueReference="6"/><Output valueReference="7"/><InitialUnknown valueReference="6"/><InitialUnknown valueReference="7"/>'
    else:
        unknowns = '<Unknown index="7"/><Unknown index="8"/>'
        structure = f"<Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns>"
    units = f'<UnitDefinitions><Unit name="{unit}"/></UnitDefinitions>' if unit else ""
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="{version or f"{fmi}.0"}" modelName="law" {token}="law">
<{interface} modelIdentifier="law" canHandleVariableCommunicationStepSize="true"/>
{units}<ModelVariables>{"".join(rows)}</ModelVariables>
<ModelStructure>{structure}</ModelStructure>
</fmiModelDescription>
"""


def library(folder: Path, fmi: int) -> Path:
    """The law in C as a library."""
    path = folder / f"law{fmi}.so"
    # A contracted multiplication would round otherwise than Python.
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-ffp-contract=off", "-fPIC", "-shared"]
    subprocess.run(["cc", *flags, "-o", path, SOURCES / f"fmi{fmi}.c"], check=True)
    return path


def pack(path: Path, xml: str, binaries: dict[str, Path]) -> Path:
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml", xml)
        for name, binary in binaries.items():
            file.write(binary, f"binaries/{name}")
    return path


def in_c(folder: Path, fmi: int) -> Path:
    return pack(folder / f"c{fmi}.fmu", description(fmi), {f"{PLATFORMS[fmi]}/law.so": library(folder, fmi)})


def by_generator(folder: Path, fmi: int) -> Path:
    """The law by pythonfmu or pythonfmu3."""
    generator = {2: "pythonfmu", 3: "pythonfmu3"}[fmi]
    into = folder / generator
    into.mkdir()
    subprocess.run(
        [sys.executable, "-m", generator, "build", "-f", SOURCES / f"python{fmi}.py", "-d", into],
        check=True,
        stdout=subprocess.DEVNULL,
        cwd=into,
    )
    (built,) = into.glob("*.fmu")
    return built
