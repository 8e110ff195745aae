"""Runs a proof: python tests/proofs/run.py fuzz|models|real_time|service_machine [its options]

Each folder here is a proof; its run.py says what it proves. `--help` after a name shows the
options.
"""

import runpy
import sys
from pathlib import Path

PROOFS = sorted(file.parent.name for file in Path(__file__).parent.glob("*/run.py"))


def main() -> None:
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name not in PROOFS:
        raise SystemExit(f"{__doc__}\nno proof '{name}'; there are {', '.join(PROOFS)}")
    del sys.argv[1]
    runpy.run_module(f"{name}.run", run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
