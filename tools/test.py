"""Runs the tests that a change can break: all of them, or those that the arguments name.

What runs prints into build/test/<step>.log; its closing lines are shown, and most of it when it
fails. Tests marked `check` are left to `make check`, unless their file is named.
"""

import argparse
import subprocess
import sys
import time

from checkout_state import PassedSteps
from outcomes import Outcomes
from selection import NoSuchTestsError, Selection, names, select
from sources import ROOT, all_left_to_check
from steps import PASSED, Step, build, ctest, processor_time, pytest, run, run_beside, use_tools


def set_up(chosen: Selection, *, everything: bool) -> bool:
    """Installs what these tests need: packages for Python, all tools for those marked `check`."""
    purpose = "test" if everything or chosen.python else "tools"
    if chosen.names_files and any(all_left_to_check(file) for file in chosen.files()):
        purpose = "check"
    return subprocess.run(["tools/setup.sh", purpose], cwd=ROOT).returncode == 0


def test_everything() -> bool:
    """The tests in C++ run beside those in Python: both wait a lot."""
    tests = [
        ctest("dev", "-LE", "^check$", report="cpp"),
        pytest("-m", "not check", report="python"),
    ]
    passed, found = PassedSteps(PASSED), Outcomes()
    for step in tests:
        passed.forget(step.name)
    if not run(Step("build", build("dev"))) or run_beside([[test] for test in tests], len(tests)):
        return False
    for step in tests:
        passed.add(step.name)
        found.add(step.outcomes())
    tell(found)
    print(f"left to make check: {left_to_check()} tests in C++")
    return True


def test_some(chosen: Selection, keyword: str | None) -> bool:
    found = Outcomes()
    for step in steps_of(chosen, keyword):
        if not run(step):
            return False
        found.add(step.outcomes())
    tell(found)
    return True


def tell(found: Outcomes) -> None:
    for name, why in found.gaps().items():
        print(f"skipped: {name}: {why}")


def steps_of(chosen: Selection, keyword: str | None) -> list[Step]:
    """Builds and runs no more than what was asked for."""
    steps = []
    if chosen.cpp:
        targets = [f"o80_test_{folder}" for folder in chosen.cpp]
        pattern = chosen.cpp_pattern() + (f".*{keyword}" if keyword else "")
        steps.append(Step("build", build("dev", *targets)))
        steps.append(ctest("dev", "-R", pattern, "-LE", "^check$", report="some_cpp"))
    if chosen.needs_programs:
        steps.append(Step("build", build("dev")))
    if chosen.python:
        marked = [] if chosen.names_files else ["-m", "not check"]
        by_keyword = ["-k", keyword] if keyword else []
        processes = {"processes": 1} if chosen.names_files and len(chosen.python) == 1 else {}
        options = (*marked, *by_keyword, *chosen.python)
        steps.append(pytest(*options, report="some_python", **processes))
    return steps


def left_to_check() -> int:
    """How many tests in C++ only `make check` runs; pytest tells its own number."""
    listed = subprocess.run(
        ["ctest", "--preset", "dev", "-N", "-L", "^check$"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    return int(listed.stdout.rpartition("Total Tests:")[2].strip() or 0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    what = f"all by default; a path of tests, or one of {', '.join(names())}"
    parser.add_argument("tests", nargs="*", help=what)
    parser.add_argument("-k", dest="keyword", help="only tests whose name contains this")
    arguments = parser.parse_args()
    use_tools()
    try:
        chosen = select(arguments.tests)
    except NoSuchTestsError as error:
        print(error, file=sys.stderr)
        return 2
    everything = not arguments.tests and not arguments.keyword
    if not arguments.tests and arguments.keyword:
        chosen = select(["cpp", "python", "processes", "consumer"])
    if not set_up(chosen, everything=everything):
        return 1

    begin, used = time.monotonic(), processor_time()
    if not (test_everything() if everything else test_some(chosen, arguments.keyword)):
        return 1
    what = "all tests passed" if everything else "these tests passed"
    seconds, used = time.monotonic() - begin, processor_time() - used
    print(f"{what} in {seconds:.0f} s ({used:.0f} s of processor time), set-up not counted")
    return 0


if __name__ == "__main__":
    sys.exit(main())
