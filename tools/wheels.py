"""Builds wheels and source distributions of all packages into build/wheels and build/sdists.

Compiled wheels are repaired to run on other machines of the platform: they bring the libraries that
are not on every machine, except MuJoCo, which has a wheel of its own. Those for the interpreter of
.venv compile only what tools/setup.sh has not compiled yet; --python adds those for another one.
"""

import argparse
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

from build_requirements import PACKAGES, pyproject, requirements
from sources import ROOT

PLATFORM = f"manylinux_2_35_{platform.machine()}"
PIP = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
CCACHE = {  # as in tools/setup.sh
    "CMAKE_CXX_COMPILER_LAUNCHER": "ccache",
    "CCACHE_DIR": f"{ROOT}/build/ccache",
    "CCACHE_NOHASHDIR": "1",
    "CCACHE_BASEDIR": str(ROOT),
}


def run(*command: str | Path, **environment: str) -> str:
    """Runs a command; returns its output. One that fails ends this program with it."""
    done = subprocess.run(
        command,
        cwd=ROOT,
        env=environment | os.environ,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if done.returncode != 0:
        sys.exit(f"failed: {' '.join(map(str, command))}\n{done.stdout}")
    return done.stdout


def tag_of(python: str) -> str:
    """The tag of wheels for an interpreter, such as cp313."""
    return run(python, "-c", "import sys; print('cp%d%d' % sys.version_info[:2])").strip()


def has_bindings(folder: str) -> bool:
    """True if a package is compiled for each interpreter."""
    return any(
        name.startswith("nanobind") for name in pyproject(folder)["build-system"]["requires"]
    )


def environment_of(python: str, place: Path) -> Path:
    """The interpreter of a new environment of `python`, with what building needs."""
    run(python, "-m", "venv", "--without-pip", "--clear", place)
    made = place / "bin" / "python"
    run(*PIP, "--python", made, "install", *requirements("build", []))
    return made


def build_wheel(folder: str, target: Path, python: Path, builds: Path) -> Path:
    """The wheel of a package, repaired if it is compiled. It is built below `builds`."""
    name = pyproject(folder)["project"]["name"]
    plain = ROOT / "build" / "plain_wheels" / name
    shutil.rmtree(plain, ignore_errors=True)
    options = ["--no-deps", "--no-build-isolation", f"-Cbuild-dir={builds / name}"]
    options += [f"-Ccmake.define.o80_DIR={ROOT}/cmake/checkout", f"--wheel-dir={plain}"]
    ccache = CCACHE if shutil.which("ccache") else {}
    run(*PIP, "--python", python, "wheel", *options, ROOT / folder, **ccache)
    (wheel,) = plain.iterdir()
    if wheel.name.endswith("-none-any.whl"):
        return Path(shutil.copy(wheel, target))
    before = set(target.iterdir())
    options = [f"--plat={PLATFORM}", "--only-plat", "--exclude=libmujoco.so*"]
    run(sys.executable, "-m", "auditwheel", "repair", *options, f"--wheel-dir={target}", wheel)
    (repaired,) = set(target.iterdir()) - before
    return repaired


def build_sdist(folder: str, target: Path) -> Path:
    """The source distribution of a package."""
    before = set(target.iterdir())
    run(sys.executable, "-m", "build", "--sdist", "--no-isolation", f"-o{target}", ROOT / folder)
    (made,) = set(target.iterdir()) - before
    return made


def tell(made: Path) -> None:
    print(f"{made.stat().st_size / 1e3:7.0f} kB  {made}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "build", help="default: build")
    parser.add_argument("--python", action="append", default=[], help="another interpreter, too")
    arguments = parser.parse_args()
    wheels, sdists = (arguments.output.absolute() / kind for kind in ("wheels", "sdists"))
    for target in (wheels, sdists):
        shutil.rmtree(target, ignore_errors=True)  # files of older sources have the same names
        target.mkdir(parents=True)
    for folder in PACKAGES:
        tell(build_wheel(folder, wheels, Path(sys.executable), ROOT / "build" / "pip"))
        tell(build_sdist(folder, sdists))
    others = {tag_of(python): python for python in arguments.python}
    others.pop(tag_of(sys.executable), None)
    for tag, python in others.items():
        builds = ROOT / "build" / tag
        made = environment_of(python, builds / "environment")
        for folder in filter(has_bindings, PACKAGES):
            tell(build_wheel(folder, wheels, made, builds))


if __name__ == "__main__":
    main()
