"""Runs all tests, or the tests that the arguments name.

Each step writes build/test/<step>.log, and prints its closing lines, or most of the log after a
failure. Tests marked `check` are left to `make check`, unless their file is named.
"""

import argparse
import subprocess
import sys

from outcomes import Outcomes
from selection import LEROBOT, NAMED, Selection, select
from sources import ROOT, all_left_to_check
from steps import (
    LOGS,
    Step,
    build,
    ctest,
    pytest,
    pytest_of_lerobot,
    run,
    run_beside,
    times,
    use_tools,
)

NEED_PROGRAMS = ("tests/processes", "tests/consumer")  # tests that run programs of the preset dev


def set_up(chosen: Selection, *, everything: bool) -> bool:
    """Installs Python packages for these tests, and all tools for tests marked `check`."""
    purpose = "test" if everything or chosen.python else "tools"
    if not everything and (chosen.lerobot or any(map(all_left_to_check, chosen.files()))):
        purpose = "check"
    return subprocess.run(["tools/setup.sh", purpose], cwd=ROOT).returncode == 0


def all_steps() -> tuple[list[list[str]], list[Step]]:
    """Returns the build commands, and the steps of the C++ and Python tests."""
    return build("dev"), [
        Step("test_cpp", [ctest("test_cpp", "dev", "-LE", "^check$")]),
        Step("test_python", [pytest("test_python", "-m", "not check")]),
    ]


def some_steps(chosen: Selection, keyword: str | None) -> tuple[list[list[str]], list[Step]]:
    """Same as all_steps(), but builds and runs only the chosen tests."""
    needs_programs = any(path.startswith(NEED_PROGRAMS) for path in chosen.python)
    targets = [] if needs_programs else [f"o80_test_{folder}" for folder in chosen.cpp]
    tests = []
    if chosen.cpp:
        pattern = chosen.cpp_pattern() + (f".*{keyword}" if keyword else "")
        tests.append(Step("some_cpp", [ctest("some_cpp", "dev", "-R", pattern, "-LE", "^check$")]))
    named = ["-k", keyword] if keyword else []
    if chosen.python:
        paths = chosen.python
        only_files = len(chosen.files()) == len(paths)
        options = [f"--ignore={LEROBOT}", *([] if only_files else ["-m", "not check"]), *named]
        processes = {"processes": 1} if only_files and len(paths) == 1 else {}
        tests.append(Step("some_python", [pytest("some_python", *options, *paths, **processes)]))
    if chosen.lerobot:
        tests.append(Step("lerobot", [pytest_of_lerobot(*named, *chosen.lerobot)]))
    return build("dev", *targets) if targets or needs_programs else [], tests


def left_to_check() -> int:
    """Counts the C++ tests that only `make check` runs; pytest reports its own number."""
    command = ["ctest", "--preset", "dev", "-N", "-L", "^check$"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return int(listed.stdout.rpartition("Total Tests:")[2].strip() or 0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    what = f"all by default; a path of tests, or one of {', '.join(sorted(NAMED))}"
    parser.add_argument("tests", nargs="*", help=what)
    parser.add_argument("-k", dest="keyword", help="only tests whose name contains this")
    arguments = parser.parse_args()
    everything = not arguments.tests and not arguments.keyword
    use_tools()
    try:
        words = arguments.tests or [name for name in NAMED if name != "lerobot"]
        chosen = select([] if everything else words)
    except ValueError as error:
        parser.error(str(error))
    if not set_up(chosen, everything=everything):
        return 1
    commands, tests = all_steps() if everything else some_steps(chosen, arguments.keyword)
    # C++ and Python tests run at the same time: both wait a lot
    chains = [[step] for step in tests]
    if (commands and not run(Step("build", commands))) or run_beside(chains, len(chains)):
        return 1
    found = Outcomes()
    for step in tests:
        found.read_report(LOGS / f"{step.name}.xml")
    found.tell()
    if everything:
        print(f"left to make check: {left_to_check()} tests in C++")
    print(f"{'all' if everything else 'these'} tests passed in {times()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
