"""A folder of scripts/release, installed where there is no source and no Rust: new controllers are made, built, run and judged, and
every tutorial is followed.

    installed.py FOLDER
    installed.py FOLDER --tutorials             # only those that need no project

As root, the source is hidden by a mount while it runs. It needs a C and a C++ compiler, pkg-config, and packages from PyPI.
"""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
LANGUAGES = ["python", "c", "cpp"]
#: Programs that a build from source would need.
RUST = ["cargo", "rustc", "rustup"]
AIM_S = 60.0


class Installed:
    """A copy of the release folder, and the environment of a user who has nothing else."""

    def __init__(self, release: Path, root: Path) -> None:
        self.root = root
        self.sdk = root / "masseter größe 2"
        shutil.copytree(release, self.sdk, symlinks=True)
        home = root / "home"
        home.mkdir()
        tools = root / "tools"
        path = [self.sdk / "bin", tools / "bin", "/usr/local/bin", "/usr/bin", "/bin"]
        # Nothing else of this environment: pip may need to know where its index is.
        kept = {name: value for name, value in os.environ.items() if name.startswith("PIP_") or name.lower().endswith("_proxy")}
        self.environment = {**kept, "HOME": str(home), "LANG": "C.UTF-8", "NO_COLOR": "1", "PATH": ":".join(map(str, path))}
        found = [name for name in RUST if shutil.which(name, path=self.environment["PATH"])]
        assert not found, f"Rust is on the PATH: {found}"
        subprocess.run([sys.executable, "-m", "venv", str(tools)], check=True, env=self.environment)

    def shell(self, command: str, folder: Path | None = None, code: int = 0) -> str:
        """What a command prints, which must end with this code."""
        ended = subprocess.run(
            command, shell=True, cwd=folder or self.root, env=self.environment, capture_output=True, text=True, timeout=540
        )
        assert ended.returncode == code, f"{command}: {ended.returncode}\n{ended.stdout}{ended.stderr}"
        return ended.stdout + ended.stderr

    def digest(self, program: str) -> str:
        """The digest of a run that passes."""
        arguments = f"--clock lockstep --duration 2 --quiet --format json --controller '{program}'"
        summary = json.loads(self.shell(f"masseter run {arguments} 2>errors"))
        assert summary["verdict"]["word"] == "PASS", summary["verdict"]
        return summary["figures"]["digest"]


def check_content(folder: Path) -> None:
    """Every file has its checksum; no file knows where the source was; every crate in a program has its licence."""
    lines = [line.split("  ", 1) for line in (folder / "SHA256SUMS").read_text().splitlines()]
    sums = {name: digest for digest, name in lines}
    files = {str(path.relative_to(folder)): path for path in folder.rglob("*") if path.is_file()}
    assert sums.keys() == files.keys() - {"SHA256SUMS"}, sums.keys() ^ files.keys()
    licences = (folder / "LICENSES/CRATES.txt").read_text().partition("-----")[0].splitlines()
    listed = {"-".join(line.partition(":")[0].split()) for line in licences}
    compiled: set[str] = set()
    for name in sums:
        content = files[name].read_bytes()
        assert hashlib.sha256(content).hexdigest() == sums[name], name
        assert f"{PROJECT}/".encode() not in content, f"{name} has the path {PROJECT}"
        # A program names the files where it can panic.
        compiled |= {crate.decode() for crate in re.findall(rb"/registry/src/[^/]+/([\w.+-]+)/src/", content)}
    assert len(compiled) > 10 and compiled <= listed, f"without a licence: {compiled - listed}"
    print(f"{len(sums)} files; {len(compiled)} of {len(listed)} crates are named by the programs, all with a licence")


def check_linking(installed: Installed) -> None:
    said = installed.shell(f"ldd '{installed.sdk}/bin/masseter' || true")
    is_static = "statically linked" in said or "not a dynamic executable" in said
    assert is_static == (installed.sdk / "LICENSES/C-LIBRARY.txt").exists(), said
    print(f"command: {installed.shell('masseter --version').strip()}, {'static' if is_static else 'dynamic'}")


def new_project(installed: Installed, language: str) -> tuple[str, str]:
    """How a new project is built, and its program."""
    said = installed.shell(f"masseter new controller --lang {language} {language}")
    build, program = re.search(r"next: \(cd \w+ && (.*)\) && masseter run --controller (\S+)", said).groups()
    return build, program


def check_projects(installed: Installed) -> str:
    # The project's own build command calls CMake.
    installed.shell("pip install --quiet --disable-pip-version-check cmake")
    digests = {}
    for language in LANGUAGES:
        began_s = time.monotonic()
        build, program = new_project(installed, language)
        installed.shell(build, installed.root / language)
        digests[language] = installed.digest(program)
        took_s = time.monotonic() - began_s
        print(f"{language}: from nothing to a judged controller in {took_s:.1f} s (aim {AIM_S:.0f} s), digest {digests[language]}")
    assert len(set(digests.values())) == 1, digests
    refused = installed.shell("masseter new controller --lang rust rust", code=2)
    assert "needs Masseter's source" in refused and "--sdk" in refused, refused
    return digests["c"]


def check_pkg_config(installed: Installed, expected: str) -> None:
    """Both libraries by the compiler alone; the program with the static one needs no file of the folder."""
    # pkg-config marks what a shell would split, and eval reads the marks.
    found = f"$(PKG_CONFIG_PATH='{installed.sdk}/lib/pkgconfig' pkg-config --cflags --libs"
    rpath = f"-Wl,-rpath,'{installed.sdk}/lib'"
    for package, more in [("masseter", rpath), ("masseter-static", "")]:
        installed.shell(f'eval "cc -O2 -ffp-contract=off c/controller.c -o {package} {found} {package}) {more} -lm"')
        needed = installed.shell(f"ldd ./{package}")
        assert ("libmasseter_c" in needed) == (package == "masseter"), needed
        assert installed.digest(f"./{package}") == expected
    print("pkg-config: the shared and the static library give the same digest")


def check_package(installed: Installed) -> None:
    program = "import masseter; print(masseter.run(clock='virtual', duration=2).verdict)"
    said = installed.shell(f'python/.venv/bin/python -c "{program}"').strip()
    assert said == "PASS", said
    print("package: masseter.run passes")


#: Ends the output of a command, before its exit code.
MARK = "\x01"
#: This tutorial makes a project, and pip then installs an environment of its own.
OF_A_PROJECT = "your-controller"


def console_steps(text: str) -> list[tuple[str, str]]:
    """Each command of the console blocks, with the output that the document shows; `> ` continues a command."""
    blocks = "".join(re.findall(r"^```console\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
    steps = re.findall(r"^\$ (.*\n(?:> .*\n)*)((?:(?!\$ ).*\n)*)", blocks, re.MULTILINE)
    return [(command.replace("\n> ", "\n").rstrip("\n"), shown) for command, shown in steps]


def follow(installed: Installed, document: Path) -> int:
    """Every command shows what the document says, in one shell and a new folder with the examples; … is text left out."""
    text = document.read_text()
    steps = console_steps(text)
    folder = installed.root / "tutorials" / document.stem
    folder.mkdir(parents=True)
    if "](../install.md#examples-and-documents)" in text:
        shutil.copytree(installed.sdk / "examples", folder / "examples")
    script = "".join(f"{command}\nprintf '{MARK}%d\\n' $?\n" for command, _ in steps)
    said = installed.shell(f"exec 2>&1\n{script}", folder).split(MARK)
    for (command, shown), output, code in zip(steps, [said[0], *(rest.partition("\n")[2] for rest in said[1:])], said[1:], strict=False):
        expected = re.escape(re.sub("^…\n", "…", shown, flags=re.MULTILINE)).replace("…", ".*")
        assert code.startswith("0\n") and re.fullmatch(expected, output, re.DOTALL), f"{document}: $ {command}\n{output}\nexit code {code}"
    assert len(said) == len(steps) + 1, f"{document}: the shell ended early"
    if ">>> " in text:
        packages = " ".join(re.findall(r"`pip install (\S+)`", text))
        wheel = next(installed.sdk.glob("masseter-*.whl"))
        installed.shell(f"pip install --quiet --disable-pip-version-check '{wheel}' {packages}")
        installed.shell(f"python -m doctest '{document}'", folder)
    return len(steps) + text.count(">>> ")


def check_tutorials(installed: Installed, with_projects: bool) -> None:
    """A reader has the documents of the folder, and an empty one."""
    documents = sorted((installed.sdk / "docs/tutorials").glob("*.md"))
    documents = [document for document in documents if with_projects or document.stem != OF_A_PROJECT]
    for document in documents:
        for link in re.findall(r"\]\(([^)#:]+)", document.read_text()):
            assert (document.parent / link).exists(), f"{document}: {link} is not in the folder"
    # Two at a time: each document has a folder of its own.
    with ThreadPoolExecutor(2) as pool:
        counts = dict(zip(documents, pool.map(lambda document: follow(installed, document), documents), strict=True))
    assert all(counts.values()) and len(counts) >= 6, counts
    print(f"tutorials: {sum(counts.values())} commands of {len(counts)} pages show what they say without the source")


def without_source(arguments: list[str]) -> None:
    """Starts this program again where mounts are its own, as far as that is allowed."""
    if os.geteuid() != 0 or shutil.which("unshare") is None:
        print("the source is not hidden, for which root is needed")
        return
    os.execvp("unshare", ["unshare", "--mount", sys.executable, __file__, *arguments, HIDDEN])


HIDDEN = "--hide-source"
TUTORIALS = "--tutorials"


def main(release: str, *options: str) -> None:
    if HIDDEN not in options:
        without_source([release, *options])
    with tempfile.TemporaryDirectory() as name:
        installed = Installed(Path(release), Path(name))
        if HIDDEN in options:
            subprocess.run(["mount", "-t", "tmpfs", "none", str(PROJECT)], check=True)
            assert not (PROJECT / "Cargo.toml").exists()
        if TUTORIALS in options:
            check_tutorials(installed, with_projects=False)
            return
        check_content(installed.sdk)
        check_linking(installed)
        expected = check_projects(installed)
        check_pkg_config(installed, expected)
        check_package(installed)
        check_tutorials(installed, with_projects=True)


main(*sys.argv[1:])
