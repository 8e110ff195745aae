"""Boots a PREEMPT_RT kernel in software and runs there, in real-time classes, the statically linked
core tests and a loop beside cyclictest. Ends with 1, and shows what was printed, if anything is
wrong.

Emulated time is slow: lateness is shown, not judged.
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

from checkout import ROOT
from real_time.doctor import faults_of_the_doctor
from real_time.image import make_image
from real_time.kernel import NoKernelError, obtain_kernel
from real_time.machine import boot
from real_time.verdict import Findings, faults, report

# tests that need what a machine of static programs does not have, or prove nothing there
LEFT_OUT = (
    # robot libraries: a static program loads none. o80-rt-loop runs a robot of its own instead
    "LibraryTest.*",
    "RunTest*",
    "ServiceManagerTest.*",
    "PrivilegedTest.*",
    "InlineRobotTest.GivesTheSameRowsBitForBitAsABurstingProcess",
    "InlineRobotTest.LetsOthersWatchAndCommand",
    "InlineRobotTest.LeavesTheRestOfABurstThatItsCallerCuts",
    "InlineRobotTest.WaitsForNothingOfItsOwn",
    "GroupEqualityTest.HoldsForTheBundledRobot",
    "RobotProvenanceTest.OfARobotSaysHowToStartItAgain",
    # the machine has no sources
    "SourceHashTest.*",
    # shorter than a few steps of an emulated processor
    "SpinnerAmongOthers.*",
    # computation only, minutes of it where the processor is emulated
    "*Garbage*",
)

# A short run keeps what depends on how threads are scheduled: spinning, sleeping, waking, deaths,
# bursts, halts, the loop. It leaves out what computes, and what mostly starts processes.
LOOP = ("o80-rt-loop", "o80-rt-frontend")
SHORT = ("o80_test_memory", "o80_test_robot", "o80_test_runtime")
LEFT_OUT_OF_SHORT = (
    "AttachedSegment*",
    "DirectoryTest.*",
    "ExpressTest.*",
    "FileOwnerTest.*",
    "FollowerTest.IsCommandedOnlyFromWhereItCanBe",
    "ForeignFileTest.*",
    "GroupEqualityTest.*",
    "HaltSuccessorTest.*",
    "Hostile*",
    "IdsInFlight.*",
    "LyingOwnerTest.*",
    "MakeTableTest.*",
    "OwnedSegmentTest.*",
    "PreviewTest.IsWhatTheBackendThenDoesBitForBit",
    "ReadingTest.AResumeRefusesOneThatCannotBe",
    "ReadingTest.ARobotThatIsRightIsNeverRefused",
    "*ReplayTest.*",
    "RunOptionsTest.*",
    "StartRaceTest.*",
    "TakeOverTest.*",
    "Typed*",
)


def build(tests: tuple[str, ...]) -> Path:
    """Builds the programs of the machine; where they lie."""
    subprocess.run(["cmake", "--preset", "rt"], cwd=ROOT, check=True)
    jobs = str(len(os.sched_getaffinity(0)))
    targets = ["--target", *tests, *LOOP, "-j", jobs]
    subprocess.run(["cmake", "--build", "--preset", "rt", *targets], cwd=ROOT, check=True)
    return ROOT / "build" / "rt"


def show_slowest(findings: Findings) -> None:
    slowest = sorted(findings.durations().items(), key=lambda each: -each[1])[:5]
    print("slowest:", ", ".join(f"{suite}* {seconds:.1f} s" for suite, seconds in slowest))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kernel", type=Path, help="a PREEMPT_RT kernel; default: Debian's")
    parser.add_argument("--build", type=Path, help="folder of programs that are built already")
    parser.add_argument("--frequency", type=int, default=1000, help="of the loop [Hz]")
    parser.add_argument("--iterations", type=int, help="of the loop (default: 3000)")
    parser.add_argument("--limit", type=float, default=600, help="of one suite [s]")
    parser.add_argument("--timeout", type=float, default=2700, help="of the machine [s]")
    parser.add_argument("--filter", default="*", help="of the tests, as GoogleTest takes it")
    parser.add_argument(
        "--short", action="store_true", help=f"only {', '.join(SHORT)}, and 1000 iterations"
    )
    parser.add_argument("--doctor", action="store_true", help="only the faults it has to find")
    arguments = parser.parse_args()
    if arguments.build is None and arguments.doctor:
        arguments.build = ROOT / "build" / "rt"
    elif arguments.build is None:
        arguments.build = build(SHORT if arguments.short else ("o80-core-tests",))

    machine = arguments.build / "machine"
    try:
        kernel = arguments.kernel or obtain_kernel(machine)
    except NoKernelError as error:
        if arguments.short:  # the tests of every day go on where there is no such kernel
            print(f"skipped: {error}")
            return 0
        print(error, file=sys.stderr)
        return 1
    begin = time.monotonic()
    wrong = [] if arguments.short else [*faults_of_the_doctor(kernel, machine, arguments.timeout)]
    if not arguments.doctor:
        wrong += wrong_in_tests(arguments, kernel)
    for each in wrong:
        print(f"WRONG: {each}")
    seconds = time.monotonic() - begin
    print(f"{'failed' if wrong else 'all held'} on a PREEMPT_RT kernel, in {seconds:.0f} s")
    return int(bool(wrong))


def wrong_in_tests(arguments: argparse.Namespace, kernel: Path) -> list[str]:
    """Runs tests and a loop in the machine, and prints what they did; what is wrong."""
    machine = arguments.build / "machine"
    tests = sorted((arguments.build / "bin").glob("o80_test_*"))
    programs = [arguments.build / "bin" / name for name in LOOP]
    if arguments.short:
        tests = [test for test in tests if test.name in SHORT]
    left_out = LEFT_OUT + LEFT_OUT_OF_SHORT * arguments.short
    if not tests or not all(program.exists() for program in programs):
        return [f"{arguments.build} holds no programs: leave out --build to have them built"]
    image = machine / "root.cpio"
    make_image(image, tests + programs)
    words = {
        "limit": f"{arguments.limit:.0f}",
        "frequency": str(arguments.frequency),
        "iterations": str(arguments.iterations or (1000 if arguments.short else 3000)),
        "tests": f"{arguments.filter}-{':'.join(left_out)}",
    }
    console = boot(kernel, image, words, arguments.timeout, machine / "console.log")
    findings = Findings.read(console)
    (machine / "passed").write_text("\n".join(findings.all("ok")))
    wrong = list(faults(console, findings, [test.name for test in tests]))
    if wrong:
        print(console.without_findings())
    print(*report(findings), sep="\n")
    show_slowest(findings)
    return wrong


if __name__ == "__main__":
    sys.exit(main())
