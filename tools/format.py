"""Formats the tree; with --check, only lists unformatted files."""

import argparse
import re
import subprocess
import sys

from sources import ROOT, cpp_files


def format_cpp() -> bool:
    return subprocess.run(["clang-format", "-i", *cpp_files()], cwd=ROOT).returncode == 0


def check_cpp() -> bool:
    """Lists the files that clang-format would change."""
    result = subprocess.run(
        ["clang-format", "--dry-run", *cpp_files()], cwd=ROOT, capture_output=True, text=True
    )
    unformatted = sorted(set(re.findall(r"^(\S+?):\d+:\d+: ", result.stderr, re.MULTILINE)))
    for file in unformatted:
        print(f"not formatted: {file} (make format)", flush=True)
    return result.returncode == 0 and not unformatted


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing, fail instead")
    check = parser.parse_args().check

    cpp_passed = check_cpp() if check else format_cpp()
    ruff = ["ruff", "format", *(["--check"] if check else []), "."]
    return int(subprocess.run(ruff, cwd=ROOT).returncode != 0 or not cpp_passed)


if __name__ == "__main__":
    sys.exit(main())
