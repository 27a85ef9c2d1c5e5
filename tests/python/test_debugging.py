"""Breakpoints in a law: pdb, breakpoint() and debugpy stop in it, and the run goes on to its verdict."""

import json
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

PROGRAM = """\
import masseter

def law(demand):
    number = demand.cycle
    return demand.ahead

print(masseter.run(controller=law, clock="virtual", duration=1, arguments=ARGUMENTS))
"""
LAWS_LINE = 1 + PROGRAM.splitlines().index("    number = demand.cycle")


def program(folder: Path, arguments: str = "[]") -> Path:
    path = folder / "program.py"
    path.write_text(PROGRAM.replace("ARGUMENTS", arguments))
    return path


def test_pdb_stops_in_a_law_and_the_run_passes(tmp_path: Path) -> None:
    commands = [f"b {LAWS_LINE}", "c", "p ('stopped in cycle', demand.cycle)", "clear 1", "c", "q"]
    options = [word for command in commands for word in ("-c", command)]
    said = subprocess.run(
        [sys.executable, "-m", "pdb", *options, program(tmp_path)], stdout=subprocess.PIPE, text=True, timeout=60
    ).stdout
    assert "('stopped in cycle', 233)" in said and "PASS: every check passed" in said, said


def test_a_breakpoint_in_the_source_stops_too(tmp_path: Path) -> None:
    path = program(tmp_path, "['--patience', 'none']")
    path.write_text(path.read_text().replace("    number", "    if demand.cycle == 300: breakpoint()\n    number"))
    said = subprocess.run(
        [sys.executable, path], input="p ('stopped in cycle', demand.cycle)\nc\n", stdout=subprocess.PIPE, text=True, timeout=60
    ).stdout
    assert "('stopped in cycle', 300)" in said and "PASS: every check passed" in said, said


class Debugger:
    """A client of the debug adapter protocol."""

    def __init__(self, port: int) -> None:
        self._line = socket.create_connection(("127.0.0.1", port), timeout=60)
        self._stream = self._line.makefile("rwb")
        self._sent = 0

    def send(self, command: str, **arguments: Any) -> int:
        self._sent += 1
        body = json.dumps({"seq": self._sent, "type": "request", "command": command, "arguments": arguments}).encode()
        self._stream.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self._stream.flush()
        return self._sent

    def _next(self) -> dict[str, Any]:
        length = 0
        while (line := self._stream.readline().strip()) or not length:
            length = int(line.split(b":")[1]) if line.lower().startswith(b"content-length") else length
        message: dict[str, Any] = json.loads(self._stream.read(length))
        return message

    def event(self, name: str) -> dict[str, Any]:
        while (message := self._next()).get("event") != name:
            pass
        body: dict[str, Any] = message.get("body", {})
        return body

    def ask(self, command: str, **arguments: Any) -> dict[str, Any]:
        number = self.send(command, **arguments)
        while (message := self._next()).get("request_seq") != number or message["type"] != "response":
            pass
        assert message["success"], message
        body: dict[str, Any] = message.get("body", {})
        return body


def test_debugpy_attaches_and_stops_in_a_law(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    path = program(tmp_path)
    words = [sys.executable, "-Xfrozen_modules=off", "-m", "debugpy", "--listen", f"127.0.0.1:{port}", "--wait-for-client", str(path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as debugged:
        try:
            debugger = connected(port)
            debugger.ask("initialize", adapterID="test", clientID="test", pathFormat="path")
            debugger.send("attach", justMyCode=True)
            debugger.event("initialized")
            debugger.ask("setBreakpoints", source={"path": str(path)}, breakpoints=[{"line": LAWS_LINE}])
            debugger.send("configurationDone")
            thread = debugger.event("stopped")["threadId"]
            frame = debugger.ask("stackTrace", threadId=thread)["stackFrames"][0]
            assert (frame["name"], frame["line"]) == ("law", LAWS_LINE)
            assert debugger.ask("evaluate", expression="demand.cycle", frameId=frame["id"])["result"] == "233"
            debugger.ask("setBreakpoints", source={"path": str(path)}, breakpoints=[])
            debugger.ask("continue", threadId=thread)
            # The adapter, a process of its own, keeps the stream open.
            assert debugged.stdout is not None
            said = debugged.stdout.readline()
            debugger.send("disconnect")
        finally:
            debugged.kill()
    assert said == "PASS: every check passed\n"


def connected(port: int) -> Debugger:
    for _ in range(600):
        try:
            return Debugger(port)
        except ConnectionRefusedError:
            time.sleep(0.1)
    raise TimeoutError("debugpy does not listen")
