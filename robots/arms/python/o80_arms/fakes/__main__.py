"""Fake arm: `python -m o80_arms.fakes` lists commands, and reads them from the terminal."""

import argparse
import sys
from typing import Any

from o80.base.screen import keep_printing
from o80_arms import fakes
from o80_arms.cli import ARMS
from o80_arms.fakes.chain import FakeChain

WORDS = """\
unplug N, plug_in N       the power of servo N and of those behind it
cut, plug                 the USB cable
silent N, damages SHARE   a servo that does not answer; damaged answers
heat N C, voltage N V, overload N, torque_off N, pull N STEPS_PER_S STRENGTH"""


def obey(chain: FakeChain[Any], words: list[str]) -> None:
    """Runs a command. Raises ValueError, KeyError or IndexError for an invalid one."""
    verb, *numbers = words
    if verb in ("cut", "plug"):
        getattr(chain, verb)()
        return
    if verb == "damages":
        chain.damages = float(numbers[0])
        return
    number = int(numbers[0])
    servo = chain.servos[number]
    match verb:
        case "unplug" | "plug_in":
            getattr(chain, verb)(number)
        case "silent":
            chain.silent ^= {number}
        case "heat":
            servo.put(servo.TEMPERATURE, int(numbers[1]))
        case "voltage":
            servo.put(servo.VOLTAGE, round(10 * float(numbers[1])))
        case "overload":
            servo.overload()
        case "torque_off":
            servo.put(servo.TORQUE, 0)
        case "pull":
            servo.pull, servo.needs = float(numbers[1]), float(numbers[2])
        case _:
            raise ValueError(verb)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, epilog=WORDS)
    parser.add_argument("arm", nargs="?", choices=[*ARMS], default="so101")
    parser.add_argument("--latency", type=float, default=0.001, help="of the adapter [s]")
    given = parser.parse_args()
    make = getattr(fakes, given.arm)
    with make(latency=given.latency) as fake:
        words = " ".join(f"--{name.replace('_', '-')} {it}" for name, it in fake.options.items())
        print(f"o80 run {given.arm} {words}\n{WORDS}", flush=True)
        for line in sys.stdin:
            try:
                obey(fake.chain, line.split() or [""])
            except (ValueError, KeyError, IndexError):
                print(WORDS, flush=True)


if __name__ == "__main__":
    keep_printing()
    main()
