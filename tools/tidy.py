"""Runs clang-tidy over the sources of a build folder, in parallel.

A file that passed is not looked at again until its preprocessed text, the configuration or the
version of clang-tidy changes.
"""

import argparse
import hashlib
import json
import os
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sources import ROOT

CHECKED = ("src", "robots", "simulators")
PASSED = ROOT / "build" / "tidy"


def sources_of(build: Path) -> dict[Path, dict[str, str]]:
    """The checked files of the build folder, each with its compile command."""
    commands = json.loads((build / "compile_commands.json").read_text())
    folders = tuple(f"{ROOT / folder}{os.sep}" for folder in CHECKED)
    return {Path(c["file"]): c for c in commands if c["file"].startswith(folders)}


def digest(compilation: dict[str, str], settings: bytes) -> str:
    """Hash of all that the verdict on a file depends on."""
    words = shlex.split(compilation["command"])
    if Path(words[0]).name == "ccache":
        words = words[1:]
    output = words.index("-o")
    del words[output : output + 2]
    words.remove("-c")
    text = subprocess.run(
        [*words, "-E", "-CC"], cwd=compilation["directory"], capture_output=True, check=True
    ).stdout
    return hashlib.sha256(settings + shlex.join(words).encode() + text).hexdigest()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "dev")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    arguments = parser.parse_args()

    version = subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    settings = version + (ROOT / ".clang-tidy").read_bytes()
    PASSED.mkdir(parents=True, exist_ok=True)

    def check(item: tuple[Path, dict[str, str]]) -> bool:
        file, compilation = item
        stamp = PASSED / digest(compilation, settings)
        if stamp.exists():
            return True
        result = subprocess.run(
            ["clang-tidy", "-p", str(arguments.build), "--quiet", str(file)],
            capture_output=True,
            text=True,
        )
        if result.returncode == 0:
            stamp.touch()
            return True
        print(result.stdout, flush=True)
        if not result.stdout:
            print(result.stderr, flush=True)
        return False

    files = sources_of(arguments.build)
    with ThreadPoolExecutor(arguments.jobs) as pool:
        verdicts = list(pool.map(check, files.items()))
    print(f"clang-tidy: {verdicts.count(True)} files passed, {verdicts.count(False)} failed")
    return int(not all(verdicts))


if __name__ == "__main__":
    sys.exit(main())
