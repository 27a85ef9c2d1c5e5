"""Projects of `masseter new controller`, built as it says."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

MOST_LINES = {"pose": 60, "drives": 90}
MOST_COLUMNS = 130


def shell(command: str, folder: Path) -> str:
    ended = subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True)
    assert ended.returncode == 0, f"{command}: {ended.returncode}\n{ended.stdout}{ended.stderr}"
    return ended.stdout


def release_profile() -> str:
    """The section of Cargo.toml on the profile `release`."""
    head = "[profile.release]"
    cargo = Path(__file__).parents[2] / "Cargo.toml"
    return head + cargo.read_text().partition(head)[2].partition("[profile.dist]")[0]


def make(masseter: str, language: str, kind: str, folder: Path, target: Path) -> str:
    """The program of a new project, built by the command that `new` prints."""
    name = f"{language}_{kind}"
    said = shell(f"{masseter} new controller --lang {language} --kind {kind} {name}", folder)
    command, program = re.search(r"next: \(cd \w+ && (.*)\) && masseter run --controller (\S+)", said).groups()
    project = folder / name
    for source in [*project.glob("**/*.rs"), *project.glob("controller.*")]:
        lines = source.read_text().splitlines()
        assert len(lines) <= MOST_LINES[kind], f"{source}: {len(lines)} lines"
        assert max(map(len, lines)) <= MOST_COLUMNS, f"{source}: {max(lines, key=len)}"
    if language == "rust":
        # Target and profile are the library's in C, so that both use the same built dependencies.
        profile = folder / "profile.toml"
        profile.write_text(release_profile())
        shell(f"{command} --target-dir {target} --config {shlex.quote(str(profile))}", project)
        # Both kinds are built to the same place.
        shutil.copy(target / "release" / "my_controller", project)
        return str(project / "my_controller")
    if language == "python":
        shell(command, project)
        return str(folder / program)
    shell(command.replace("-B build", f"-B build -DMASSETER_TARGET={target}"), project)
    return str(folder / program)
