"""Runs the checks that `make test` omits: slow tests, and checks with tools of their own.

The check fails if a test was skipped, here or by `make test`, and passed in no other step;
--allow-skips only reports it.
"""

import argparse
import sys

from build_requirements import PACKAGES, pyproject
from outcomes import Outcomes
from sources import ROOT
from steps import (
    LOGS,
    PYTHON,
    Step,
    build,
    ctest,
    pytest,
    pytest_of_lerobot,
    run_beside,
    times,
    use_tools,
)

PROOF = [sys.executable, "tests/proofs/run.py"]
MODULES = [pyproject(folder)["project"]["name"].replace("-", "_") for folder in PACKAGES]
TYPED = (  # folders beside the packages, grouped so that module names are unique
    "conftest.py tools benchmarks examples docs/site tests/processes tests/tools robots/pam/tests"
    " simulators/mujoco/tests apps/table_tennis/studies apps/table_tennis/tests",
    "tests/proofs tests/python tests/consumer",
    "devices/tests",
    "robots/arms/tests",
    "gateways/lerobot/tests",
    "gateways/ros2/tests",
)
WORKFLOW = ".github/workflows/tests.yml"
TORTURE = ("--kills", "300", "--halts", "100", "--seed", "77")  # the same mixes in every run


STEPS: dict[str, list[list[str]]] = {
    "format": [[sys.executable, "tools/format.py", "--check"]],
    "ruff": [["ruff", "check", "."]],
    "workflow": [["check-jsonschema", "--builtin-schema", "vendor.github-workflows", WORKFLOW]],
    "mypy": [
        [*PYTHON, "mypy", *(word for name in MODULES for word in ("-p", name))],
        *([*PYTHON, "mypy", *folders.split()] for folders in TYPED),
    ],
    "cpp": [ctest("cpp", "dev", "-L", "^check$")],
    "python": [pytest("python", "-m", "check")],
    "lerobot": [pytest_of_lerobot("gateways/lerobot/tests")],
    "torture": [
        *build("dev", "o80-torture"),
        ["build/dev/bin/o80-torture", *TORTURE, "--python", sys.executable],
    ],
    "tidy": build("tidy"),
    "models": [[*PROOF, "models", "--no-mutants"]],
    "asan": [*build("asan"), ctest("asan", "asan")],
    "tsan": [*build("tsan"), ctest("tsan", "tsan")],
    "fuzz": [[*PROOF, "fuzz"]],
    "rt": [[*PROOF, "real_time", "--short"]],
    "arm64": [*build("arm64"), ctest("arm64", "arm64")],
}
ON_DEMAND = {"arm64", "rt"}  # minutes in an emulator
# Two chains of steps run at the same time: many steps wait, or keep one processor busy. The steps
# of a chain share a build folder. The longest chains are first.
QUICK = ("format", "ruff", "workflow")
CHAINS = (
    ("python",),
    ("asan", "fuzz"),
    ("rt",),
    ("lerobot",),
    ("models",),
    ("tsan",),
    ("tidy",),
    ("cpp", "torture"),
    ("mypy",),
    ("arm64",),
)
LANES = 2
NEED_DEV = {"cpp", "python"}  # steps that use the build of the preset dev


def run_all(names: list[str], *, keep_going: bool) -> set[str]:
    """Runs these steps; returns the names of failed ones."""
    steps = {name: Step(name, STEPS[name]) for name in names}
    first = [steps[name] for name in QUICK if name in steps]
    if NEED_DEV & set(steps):
        first.append(Step("build", build("dev")))
    failed = run_beside([first], 1, keep_going=keep_going)
    if failed and not keep_going:
        return failed
    chains = [[steps[name] for name in chain if name in steps] for chain in CHAINS]
    return failed | run_beside(chains, LANES, keep_going=keep_going)


def outcomes(names: list[str]) -> Outcomes:
    """Reads the outcomes of these steps and of the last `make test`."""
    found = Outcomes()
    for name in ("test_cpp", "test_python", *names):
        if (report := LOGS / f"{name}.xml").exists():
            found.read_report(report)
    if "rt" in names and not found.read_log("rt", LOGS / "rt.log"):
        found.passed |= set((ROOT / "build/rt/machine/passed").read_text().split())
    return found


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
    names = arguments.steps or [name for name in STEPS if name not in ON_DEMAND]
    failed = run_all(names, keep_going=arguments.keep_going)
    if failed:
        print(f"failed: {', '.join(sorted(failed))} (build/test)")
        return 1
    found = outcomes(names)
    found.tell()
    gaps = len(found.gaps())
    # a selection of steps cannot know which tests the others pass
    if gaps and not arguments.steps and not arguments.allow_skips:
        cure = 'make test first, install what is missing, or ARGS="--allow-skips"'
        print(f"failed: {gaps} skipped; {cure}")
        return 1
    print(f"{'these' if arguments.steps else 'all'} checks passed in {times()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
