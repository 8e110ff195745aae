"""Boots a PREEMPT_RT kernel in software and runs there, in real-time classes, the statically linked
core tests and a loop beside cyclictest. Ends with 1, and shows the console, if anything is wrong.

Emulated time is slow: lateness is shown, not judged.
"""

import argparse
import sys
import time
from pathlib import Path

from real_time.image import make_image
from real_time.kernel import NoKernelError, obtain_kernel
from real_time.machine import boot
from real_time.verdict import Findings, faults, report
from sources import ROOT

# tests that need what a machine of static programs does not have, or prove nothing there
LEFT_OUT = (
    # robot libraries: a static program loads none. o80-rt-loop runs a robot of its own instead
    "LibraryTest.*",
    "RunTest.*",
    "InlineRobotTest.GivesTheSameRowsBitForBitAsABurstingProcess",
    "InlineRobotTest.LetsOthersWatchAndCommand",
    "InlineRobotTest.LeavesTheRestOfABurstThatItsCallerCuts",
    "InlineRobotTest.WaitsForNothingOfItsOwn",
    # a compiler, and Python
    "Describe.Refuses*WhenItIsCompiled",
    "Json.*",
    # shorter than a few steps of an emulated processor
    "SpinnerAmongOthers.LetsThemRunAtOnceWhileSomebodyDoes",
    # computation only, minutes of it where the processor is emulated
    "ControllerProperty.*",
    "*Garbage*",
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kernel", type=Path, help="a PREEMPT_RT kernel; default: Debian's")
    parser.add_argument("--build", type=Path, default=ROOT / "build/rt", help="of preset rt")
    parser.add_argument("--frequency", type=int, default=1000, help="of the loop [Hz]")
    parser.add_argument("--iterations", type=int, default=3000, help="of the loop")
    parser.add_argument("--timeout", type=float, default=900, help="of the machine [s]")
    arguments = parser.parse_args()

    tests = sorted((arguments.build / "bin").glob("o80_test_*"))
    programs = [arguments.build / "bin" / name for name in ("o80-rt-loop", "o80-rt-frontend")]
    if not tests or not all(program.exists() for program in programs):
        parser.error(f"{arguments.build} holds no programs: run `cmake --build --preset rt` first")
    machine = arguments.build / "machine"
    try:
        kernel = arguments.kernel or obtain_kernel(machine)
    except NoKernelError as error:
        print(error, file=sys.stderr)
        return 1
    image = machine / "root.cpio"
    make_image(image, tests + programs)

    begin = time.monotonic()
    words = {
        "frequency": str(arguments.frequency),
        "iterations": str(arguments.iterations),
        "left_out": ":".join(LEFT_OUT),
    }
    console = boot(kernel, image, words, arguments.timeout, machine / "console.log")
    seconds = time.monotonic() - begin
    findings = Findings.read(console)
    wrong = list(faults(console, findings, [test.name for test in tests]))
    if wrong:
        print(console.text)
    print(*report(findings), sep="\n")
    for each in wrong:
        print(f"WRONG: {each}")
    print(f"{'failed' if wrong else 'all held'} on a PREEMPT_RT kernel, in {seconds:.0f} s")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
