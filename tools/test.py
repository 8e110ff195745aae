"""Runs the tests that a change can break: all of them, or those that the arguments name.

What runs prints into build/test/<step>.log; its closing lines are shown, and most of it when it
fails. Tests marked `check` are left to `make check`, unless their file is named.
"""

import argparse
import subprocess
import sys

from checkout_state import PassedSteps
from outcomes import Outcomes
from selection import NoSuchTestsError, Selection, names, select
from sources import ROOT
from steps import PASSED, Step, build, ctest, pytest, run, use_tools


def install() -> bool:
    """Builds and installs the packages that changed."""
    return subprocess.run(["tools/setup.sh", "test"], cwd=ROOT).returncode == 0


def all_steps() -> list[Step]:
    return [
        Step("build", build("dev")),
        ctest("dev", "-LE", "^check$", report="cpp"),
        pytest("-m", "not check", report="python"),
    ]


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
    if (everything or chosen.python) and not install():
        return 1

    passed, found = PassedSteps(PASSED), Outcomes()
    for step in all_steps() if everything else steps_of(chosen, arguments.keyword):
        if everything:
            passed.forget(step.name)
        if not run(step):
            return 1
        if everything:
            passed.add(step.name)
        found.add(step.outcomes())
    for name, why in found.gaps().items():
        print(f"skipped: {name}: {why}")
    if everything:
        print(f"left to make check: {left_to_check()} tests in C++")
    print("all tests passed" if everything else "these tests passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
