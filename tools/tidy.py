"""Runs clang-tidy over the sources of a build folder, in parallel.

Sources of a folder with equal compile options are checked as one unit, so that common headers are
read once. A unit that passed is checked again only after a change of its preprocessed text, of the
configuration or of clang-tidy's version.
"""

import argparse
import hashlib
import json
import os
import shlex
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sources import ROOT

CHECKED = ("src", "robots", "simulators", "devices")
BUILD = ROOT / "build" / "tidy"
# the static analyzer also checks included headers; it finds most within few nodes
ANALYZER = [
    word
    for option in ("-analyzer-opt-analyze-headers", "-analyzer-config", "max-nodes=30000")
    for word in ("-Xclang", option)
]


def compile_options(command: str) -> tuple[str, ...]:
    """Extracts the options that affect parsing: directories, definitions, language."""
    words = shlex.split(command)
    kept = ("-I", "-D", "-std=", "-isystem")
    options: list[str] = []
    for word, following in zip(words, [*words[1:], ""], strict=True):
        if word.startswith(kept):
            options += [word, following] if word == "-isystem" else [word]
    return tuple(options)


def units_of(build: Path) -> dict[Path, tuple[str, ...]]:
    """Writes a file for each folder and set of options, which includes the folder's sources."""
    commands = json.loads((build / "compile_commands.json").read_text())
    together: dict[tuple[str, tuple[str, ...]], set[Path]] = defaultdict(set)
    for file, options in sources_of(commands).items():
        together[str(file.parent.relative_to(ROOT)), options].add(file)
    units: dict[Path, tuple[str, ...]] = {}
    for (folder, options), files in sorted(together.items()):
        unit = BUILD / f"{folder.replace('/', '-')}-{len(units)}.cpp"
        unit.write_text("".join(f'#include "{file}"\n' for file in sorted(files)))
        units[unit] = options
    return units


def sources_of(commands: list[dict[str, str]]) -> dict[Path, tuple[str, ...]]:
    """Lists the checked files, also those inside unity sources, with the shipped options."""
    found: dict[Path, tuple[str, ...]] = {}
    tests = f"{os.sep}tests{os.sep}"  # tests of the packages, which are not shipped
    folders = tuple(f"{ROOT / folder}{os.sep}" for folder in CHECKED)
    for command in commands:
        file = Path(command["file"])
        files = [str(file)]
        if file.name.startswith("unity_"):
            lines = file.read_text().splitlines()
            files = [line.split('"')[1] for line in lines if line.startswith("#include")]
        options = compile_options(command["command"])
        for name in files:
            if not name.startswith(folders) or tests in name.removeprefix(str(ROOT)):
                continue
            # test builds have more definitions: the shortest options are the shipped ones
            found[Path(name)] = min(found.get(Path(name), options), options, key=len)
    return found


def digest(unit: Path, options: tuple[str, ...], settings: bytes) -> str:
    """Hashes all inputs of a unit's check."""
    words = ["clang++-19", *options, "-E", "-CC", str(unit)]
    text = subprocess.run(words, capture_output=True, check=True).stdout
    return hashlib.sha256(settings + text).hexdigest()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "dev")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    arguments = parser.parse_args()

    version = subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    settings = version + (ROOT / ".clang-tidy").read_bytes() + shlex.join(ANALYZER).encode()
    BUILD.mkdir(parents=True, exist_ok=True)

    def check(item: tuple[Path, tuple[str, ...]]) -> bool:
        unit, options = item
        stamp = BUILD / digest(unit, options, settings)
        if stamp.exists():
            return True
        configuration = f"--config-file={ROOT / '.clang-tidy'}"
        command = ["clang-tidy", configuration, "--quiet", str(unit), "--", *options, *ANALYZER]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode == 0:
            stamp.touch()
            return True
        print(result.stdout or result.stderr, flush=True)
        return False

    units = units_of(arguments.build)
    with ThreadPoolExecutor(arguments.jobs) as pool:
        verdicts = list(pool.map(check, units.items()))
    files = sum(unit.read_text().count("#include") for unit in units)
    print(f"clang-tidy: {files} files in {len(units)} units; {verdicts.count(False)} units failed")
    return int(not all(verdicts))


if __name__ == "__main__":
    sys.exit(main())
