"""Formats the tree; with --check, only lists unformatted files."""

import argparse
import subprocess
import sys

from sources import ROOT, cpp_files


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing, fail instead")
    check = parser.parse_args().check

    cpp = ["--dry-run", "-Werror", "--ferror-limit=1"] if check else ["-i"]
    formatters = [
        ["clang-format", *cpp, *cpp_files()],
        ["ruff", "format", *(["--check"] if check else []), "."],
    ]
    return sum(subprocess.run(each, cwd=ROOT).returncode != 0 for each in formatters)


if __name__ == "__main__":
    sys.exit(main())
