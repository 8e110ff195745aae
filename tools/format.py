"""Formats the tree; with --check only says what is not formatted."""

import argparse
import subprocess
import sys

from sources import ROOT, cpp_files


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing, fail instead")
    check = parser.parse_args().check

    clang_format = ["clang-format", *(["--dry-run", "-Werror"] if check else ["-i"]), *cpp_files()]
    ruff_format = ["ruff", "format", *(["--check"] if check else []), "."]
    failures = [
        subprocess.run(command, cwd=ROOT).returncode for command in (clang_format, ruff_format)
    ]
    return int(any(failures))


if __name__ == "__main__":
    sys.exit(main())
