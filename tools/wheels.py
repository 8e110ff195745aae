"""Builds wheels and source distributions of all packages into build/wheels and build/sdists.

Compiled wheels are repaired to run on other machines of the platform: they include all libraries
that may be missing there, except MuJoCo, which has its own wheel. Compiles only what
tools/setup.sh has not compiled yet.
"""

import argparse
import platform
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from build_requirements import PACKAGES

ROOT = Path(__file__).resolve().parent.parent
PLATFORM = f"manylinux_2_35_{platform.machine()}"
PIP = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]


def run(*command: str | Path) -> None:
    """Runs a command; a failure ends this program with the command's output."""
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        sys.exit(f"failed: {' '.join(map(str, command))}\n{done.stdout.decode()}")


def build_wheel(folder: str, target: Path) -> Path:
    """Builds the wheel of a package, repaired if compiled."""
    name = tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"]["name"]
    plain = ROOT / "build" / "plain_wheels" / name
    shutil.rmtree(plain, ignore_errors=True)
    options = ["--no-deps", "--no-build-isolation", f"-Cbuild-dir={ROOT}/build/pip/{name}"]
    run(*PIP, "wheel", *options, f"--wheel-dir={plain}", ROOT / folder)
    (wheel,) = plain.iterdir()
    if wheel.name.endswith("-none-any.whl"):
        return Path(shutil.copy(wheel, target))
    before = set(target.iterdir())
    options = [f"--plat={PLATFORM}", "--only-plat", "--exclude=libmujoco.so*"]
    run(sys.executable, "-m", "auditwheel", "repair", *options, f"--wheel-dir={target}", wheel)
    (repaired,) = set(target.iterdir()) - before
    return repaired


def build_sdist(folder: str, target: Path) -> Path:
    """Builds the source distribution of a package."""
    before = set(target.iterdir())
    run(sys.executable, "-m", "build", "--sdist", "--no-isolation", f"-o{target}", ROOT / folder)
    (made,) = set(target.iterdir()) - before
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "build", help="default: build")
    output = parser.parse_args().output.absolute()
    for kind, build in (("wheels", build_wheel), ("sdists", build_sdist)):
        target = output / kind
        shutil.rmtree(target, ignore_errors=True)  # older files would have the same names
        target.mkdir(parents=True)
        for folder in PACKAGES:
            made = build(folder, target)
            print(f"{made.stat().st_size / 1e3:7.0f} kB  {made}", flush=True)


if __name__ == "__main__":
    main()
