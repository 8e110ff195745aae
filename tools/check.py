"""Checks everything: what `make test` runs, its slow tests, and what needs tools of its own.

Steps that `make test` passed on exactly these files are not run again. A test that was skipped and
passed in no other step fails the check; --allow-skips only tells of it.
"""

import argparse
import sys
import time
from collections.abc import Callable

from checkout_state import PassedSteps
from outcomes import Outcomes, of_ctest, of_log, of_pytest, of_real_time_machine
from sources import ROOT
from steps import (
    LOGS,
    PASSED,
    PYTHON,
    Step,
    build,
    cpp,
    processor_time,
    pytest,
    run_beside,
    use_tools,
)

PROOF = [sys.executable, "tests/proofs/run.py"]
PACKAGES = ("o80", "o80_mujoco", "o80_pam", "o80_devices", "o80_table_tennis")
TYPED = (  # beside the packages
    "tools",
    "benchmarks",
    "examples",
    "apps/table_tennis/studies",
    "tests/proofs",
    "conftest.py",
)
TYPED_TESTS = (
    "tests/python",
    "tests/processes",
    "tests/consumer",
    "tests/tools",
    "robots/pam/tests",
    "simulators/mujoco/tests",
    "devices/tests",
    "apps/table_tennis/tests",
)
TORTURE = ("--kills", "2000", "--halts", "300", "--seed", "77")  # the same mixes in every run


def typed() -> Step:
    mypy = [*PYTHON, "mypy"]
    # a test asks for a property again after it changed, which mypy takes for unreachable
    tests = [*mypy, "--no-warn-unreachable"]
    return Step(
        "mypy",
        [
            [*mypy, *(word for name in PACKAGES for word in ("-p", name))],
            *([*mypy, folder] for folder in TYPED),
            *([*tests, folder] for folder in TYPED_TESTS),
        ],
    )


def of_real_time() -> Outcomes:
    listed = ROOT / "build/rt/machine/passed"
    said = of_log("rt", LOGS / "rt.log")
    if not said.skipped:
        said.add(of_real_time_machine(listed))
    return said


def torture() -> Step:
    program = "build/dev/bin/o80-torture"
    command = [program, *TORTURE, "--python", sys.executable]
    return Step("torture", [*build("dev", "o80-torture"), command])


STEPS: dict[str, Callable[[], Step]] = {
    "format": lambda: Step("format", [[sys.executable, "tools/format.py", "--check"]]),
    "ruff": lambda: Step("ruff", [["ruff", "check", "."]]),
    "mypy": typed,
    "cpp": lambda: cpp("dev", report="cpp"),
    "python": lambda: pytest(report="python"),
    "torture": torture,
    "tidy": lambda: Step("tidy", [["cmake", "--preset", "dev"], [sys.executable, "tools/tidy.py"]]),
    "models": lambda: Step("models", [[*PROOF, "models"]]),
    "asan": lambda: cpp("asan"),
    "tsan": lambda: cpp("tsan"),
    "fuzz": lambda: Step("fuzz", [[*PROOF, "fuzz"]]),
    "rt": lambda: Step("rt", [[*PROOF, "real_time", "--short"]], outcomes=of_real_time),
    "arm64": lambda: cpp("arm64"),
}
ON_DEMAND = {"arm64"}  # an emulator's minutes
# Two chains of steps run at the same time: many steps wait, or keep one processor busy. Those of a
# chain use the same build folder. The longest come first.
QUICK = ("format", "ruff")
CHAINS = (
    ("python",),
    ("asan", "fuzz"),
    ("rt",),
    ("models",),
    ("tsan",),
    ("cpp", "torture", "tidy"),
    ("mypy",),
    ("arm64",),
)
LANES = 2
NEED_DEV = {"cpp", "python"}  # they use what the preset dev built, each in a chain of its own
# what is left of a step that `make test` passed on these files, and what was reported then
REST: dict[str, tuple[Callable[[], Step], Callable[[], Outcomes]]] = {
    "cpp": (
        lambda: cpp("dev", "-L", "^check$", report="cpp_check"),
        lambda: of_ctest(LOGS / "cpp.xml"),
    ),
    "python": (
        lambda: pytest("-m", "check", report="python_check"),
        lambda: of_pytest(LOGS / "python.xml"),
    ),
}


def planned(names: list[str], passed: PassedSteps, found: Outcomes) -> dict[str, Step]:
    """The steps to run; outcomes of what passed before are added to those found."""
    steps = {}
    for name in names:
        if name in REST and passed.contains(name):
            rest, outcomes = REST[name]
            print(f"== {name}: passed by make test on these files; left are the tests marked check")
            found.add(outcomes())
            steps[name] = rest()
        else:
            steps[name] = STEPS[name]()
    return steps


def run_all(steps: dict[str, Step], *, keep_going: bool) -> set[str]:
    """Runs all steps; the names of those that failed."""
    first = [steps[name] for name in QUICK if name in steps]
    if NEED_DEV & set(steps):
        first.append(Step("build", build("dev")))
    failed = run_beside([first], 1, keep_going=keep_going)
    if failed and not keep_going:
        return failed
    chains = [[steps[name] for name in chain if name in steps] for chain in CHAINS]
    return failed | run_beside(chains, LANES, keep_going=keep_going)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    what = f"of {', '.join(STEPS)}; by default all but {', '.join(ON_DEMAND)}"
    parser.add_argument("steps", nargs="*", help=what)
    parser.add_argument("--keep-going", action="store_true", help="run the steps after a failure")
    parser.add_argument(
        "--allow-skips", action="store_true", help="pass although tests are skipped"
    )
    arguments = parser.parse_args()
    unknown = set(arguments.steps) - set(STEPS)
    if unknown:
        parser.error(f"no step {', '.join(sorted(unknown))}; there are {', '.join(STEPS)}")

    use_tools()
    begin = time.monotonic()
    found = Outcomes()
    names = arguments.steps or [name for name in STEPS if name not in ON_DEMAND]
    steps = planned(names, PassedSteps(PASSED), found)
    failed = run_all(steps, keep_going=arguments.keep_going)
    if failed:
        print(f"failed: {', '.join(sorted(failed))} (build/test)")
        return 1
    for step in steps.values():
        found.add(step.outcomes())
    gaps = found.gaps()
    for name, why in gaps.items():
        print(f"skipped: {name}: {why}")
    # some steps alone cannot know what the others pass
    if gaps and not arguments.steps and not arguments.allow_skips:
        print(f'failed: {len(gaps)} skipped; install what is missing, or ARGS="--allow-skips"')
        return 1
    how_long = f"in {time.monotonic() - begin:.0f} s ({processor_time():.0f} s of processor time)"
    print(f"all checks passed {how_long}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
