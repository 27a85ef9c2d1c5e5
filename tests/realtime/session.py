"""The controller of session.cpp in Python. Argument: blocking or polling."""

import sys

import masseter
from masseter.messages import Command, State


def main(way: str) -> None:
    timeout_s = 0.0 if way == "polling" else None
    reading_cycle, cycles = 0, 0
    with masseter.Session() as session:
        while cycles < 5000 and not session.is_stop_requested:
            cycle = session.wait(timeout_s)
            if cycle is None:
                continue
            cycles += 1
            reading_cycle = cycle.reading.cycle if cycle.reading else reading_cycle
            command = Command(cycle=cycle.number, reading_cycle=reading_cycle)
            session.publish(command, State(cycle=cycle.number, reading_cycle=reading_cycle))
        session.finish()


main(sys.argv[1])
