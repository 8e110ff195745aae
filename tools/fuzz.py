"""Builds the fuzzers, replays what they ever found, and runs each of them further.

The corpus in tests/fuzz/corpus holds an input for each thing that can happen, those that once
broke something among them. New finds go to build/fuzz/found/<fuzzer>; `--merge` takes what is new
and small from there into the corpus.
"""

import argparse
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from sources import ROOT

FOUND = ROOT / "build" / "fuzz" / "found"
CORPUS = ROOT / "tests" / "fuzz" / "corpus"
LONGEST = 1500  # bytes of an input
# how many inputs a bounded run tries: each some ten seconds on one processor
RUNS = {"options": 10_000, "schema": 8_000, "segment": 2_000, "lane": 6_000}
JOBS = len(os.sched_getaffinity(0))
COMMON = [
    f"-max_len={LONGEST}",
    "-len_control=0",
    "-timeout=600",  # of the wall clock: a hang, not a busy machine
    "-rss_limit_mb=2500",
    "-print_final_stats=1",
]


def build() -> None:
    """Compiles the fuzzers against the library that the sanitizers watch."""
    subprocess.run(["cmake", "--preset", "asan"], cwd=ROOT, check=True)
    target = ["--target", "fuzzers", "-j", str(JOBS)]
    subprocess.run(["cmake", "--build", "--preset", "asan", *target], cwd=ROOT, check=True)


def program(name: str) -> str:
    """Where a fuzzer lies."""
    return str(ROOT / "build" / "asan" / "bin" / f"fuzz_{name}")


def fuzzer(name: str, *arguments: str) -> list[str]:
    """The command that runs one; what breaks it is kept beside its finds."""
    found = FOUND / name
    found.mkdir(parents=True, exist_ok=True)
    return [
        program(name),
        *COMMON,
        f"-artifact_prefix={found}/broken-",
        *arguments,
        str(found),
        str(CORPUS / name),
    ]


def executed(log: str) -> int:
    """How many inputs a run tried, from its closing statistics."""
    for line in log.splitlines():
        if line.startswith("stat::number_of_executed_units:"):
            return int(line.split()[-1])
    return 0


def run(name: str, *arguments: str) -> int:
    """Runs one fuzzer to its end; how many inputs it tried."""
    result = subprocess.run(
        fuzzer(name, *arguments), capture_output=True, text=True, errors="replace"
    )
    if result.returncode != 0:
        print(result.stderr[-20_000:])
        raise SystemExit(f"fuzz_{name} broke: the input lies in {FOUND / name}")
    return executed(result.stderr)


def merge(name: str) -> None:
    """Adds finds that reach something new to the corpus."""
    corpus = CORPUS / name
    corpus.mkdir(parents=True, exist_ok=True)
    found = str(FOUND / name)
    subprocess.run([program(name), *COMMON, "-merge=1", str(corpus), found], check=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("fuzzers", nargs="*", help=f"of {', '.join(RUNS)}; all by default")
    parser.add_argument(
        "--minutes", type=float, help="run each so long instead of a number of inputs"
    )
    parser.add_argument(
        "--merge", action="store_true", help="take finds into the corpus afterwards"
    )
    arguments = parser.parse_args()
    unknown = set(arguments.fuzzers) - set(RUNS)
    if unknown:
        parser.error(f"no fuzzer {', '.join(sorted(unknown))}; there are {', '.join(RUNS)}")

    build()

    def fuzz(name: str) -> tuple[int, int]:
        known = len(list((CORPUS / name).iterdir()))
        if arguments.minutes:
            tried = run(name, f"-max_total_time={round(60 * arguments.minutes)}")
        else:
            tried = run(name, f"-runs={RUNS[name] + known}", "-seed=1")
        print(f"fuzz_{name}: {tried} inputs, {known} of them known", flush=True)
        if arguments.merge:
            merge(name)
        return tried, known

    names = arguments.fuzzers or list(RUNS)
    with ThreadPoolExecutor(JOBS) as pool:
        counts = list(pool.map(fuzz, names))
    tried, known = (sum(column) for column in zip(*counts, strict=True))
    print(f"{len(names)} fuzzers, {known} known inputs, {tried} tried: nothing broke")
    return 0


if __name__ == "__main__":
    sys.exit(main())
