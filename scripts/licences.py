#!/usr/bin/env python3
"""Licences of everything that a release contains, as a folder of texts.

    licences.py FOLDER [--static] PACKAGE...
    licences.py --check [--static]      # only whether this system has the texts of its libraries: exit code 2 where it does not

CRATES.txt has each crate that the packages compile in, with its licence and the texts that it brings. Crates that only run while the
packages are built are left out: build scripts and procedural macros. A crate without a text has the one of its licence. The Rust
standard library is in every program, and with --static the C library of this system is, too.
"""

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).parents[1]
#: How the name of a file with a licence begins.
NAMES = ("licen", "copying", "notice", "copyright", "unlicense")
#: Of the system's C library, as Debian and its relatives have them: the notice, and the licence.
C_LIBRARY = [Path("/usr/share/doc/libc6-dev/copyright"), Path("/usr/share/common-licenses/LGPL-2.1")]


def metadata() -> dict:
    rustc = subprocess.run(["rustc", "-vV"], check=True, capture_output=True, text=True).stdout
    host = next(line.partition(": ")[2] for line in rustc.splitlines() if line.startswith("host"))
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", host]
    return json.loads(subprocess.run(command, cwd=PROJECT, check=True, capture_output=True, text=True).stdout)


def is_macro(package: dict) -> bool:
    return any("proc-macro" in target["kind"] for target in package["targets"])


def compiled_in(data: dict, roots: list[str]) -> list[dict]:
    """The packages of others in the trees of the roots, by name."""
    packages = {package["id"]: package for package in data["packages"]}
    edges = {node["id"]: node["deps"] for node in data["resolve"]["nodes"]}
    waiting = [key for key, package in packages.items() if package["name"] in roots and package["source"] is None]
    assert len(waiting) == len(roots), f"packages of the workspace: {roots}"
    found: set[str] = set()
    while waiting:
        key = waiting.pop()
        if key in found or is_macro(packages[key]):
            continue
        found.add(key)
        waiting += [edge["pkg"] for edge in edges[key] if any(kind["kind"] is None for kind in edge["dep_kinds"])]
    foreign = [packages[key] for key in found if packages[key]["source"]]
    return sorted(foreign, key=lambda package: (package["name"], package["version"]))


def texts(package: dict) -> list[str]:
    """The texts in a crate's folder, those of C sources within included."""
    folder = Path(package["manifest_path"]).parent
    files = [path for path in folder.rglob("*") if path.is_file() and path.name.lower().startswith(NAMES) and path.suffix != ".rs"]
    return [path.read_text(errors="replace").strip() for path in sorted(files)]


def general_text(package: dict) -> str:
    """The text of the licence of a crate that brings none."""
    holders = ", ".join(package["authors"]) or f"the authors of {package['name']}, {package['repository']}"
    if "MIT" in package["license"].split():
        _, _, permission = (PROJECT / "LICENSE-MIT").read_text().partition("\n\nPermission")
        assert permission, "LICENSE-MIT has no permission"
        return f"MIT License\n\nCopyright (c) {holders}\n\nPermission{permission}".strip()
    assert package["license"] == "Apache-2.0", f"{package['name']} {package['version']} brings no text of {package['license']}"
    return (PROJECT / "LICENSE-APACHE").read_text().strip()


def write_crates(packages: list[dict], path: Path) -> None:
    """The list of the crates, then each text once."""
    numbers: dict[str, int] = {}
    lines = []
    for package in packages:
        of_package = texts(package) or [general_text(package)]
        marks = " ".join(f"[{numbers.setdefault(text, len(numbers) + 1)}]" for text in of_package)
        lines.append(f"{package['name']} {package['version']}: {package['license']} {marks}")
    blocks = [f"[{number}]\n\n{text}" for text, number in numbers.items()]
    rule = f"\n\n{'-' * 80}\n\n"
    path.write_text(rule.join(["\n".join(lines), *blocks]) + "\n")


def rust_library() -> Path:
    root = subprocess.run(["rustc", "--print", "sysroot"], check=True, capture_output=True, text=True).stdout.strip()
    return Path(root) / "share/doc/rust/COPYRIGHT-library.html"


def write_c_library(folder: Path) -> None:
    """The system's C library is under the LGPL: whoever passes a static program on offers its source, too."""
    (folder / "C-LIBRARY.txt").write_text("\n".join(path.read_text() for path in C_LIBRARY))


def missing(is_static: bool) -> str | None:
    """What is to be done where this system lacks a text."""
    if not (path := rust_library()).is_file():
        return f"the licence of the Rust standard library is not there: {path}; rustup component add rust-docs"
    absent = [str(path) for path in C_LIBRARY if is_static and not path.is_file()]
    if absent:
        return (
            f"the licence of the C library is not there: {', '.join(absent)}. A static command contains that library. Make the release"
            " on Debian or Ubuntu with libc6-dev, or give --dynamic"
        )
    return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("packages", nargs="*")
    parser.add_argument("--static", action="store_true")
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_intermixed_args()
    if problem := missing(arguments.static):
        print(problem, file=sys.stderr)
        sys.exit(2)
    if arguments.check:
        return
    if not arguments.packages:
        parser.error("name a folder and packages")
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for name in ["LICENSE-MIT", "LICENSE-APACHE"]:
        shutil.copy(PROJECT / name, arguments.folder)
    write_crates(compiled_in(metadata(), arguments.packages), arguments.folder / "CRATES.txt")
    shutil.copy(rust_library(), arguments.folder / "RUST-STANDARD-LIBRARY.html")
    if arguments.static:
        write_c_library(arguments.folder)


if __name__ == "__main__":
    main()
