"""Builds the fuzzers, replays the corpus, and runs each fuzzer further.

New finds go to build/fuzz/found/<fuzzer>. `--merge` adds those that reach something new to the
corpus; `--add FILE...` adds inputs of your own, `broken-*` among the finds for example.
"""

import argparse
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from checkout import ROOT
from fuzz.corpus import UNPACKED, archive_of, pack, unpack

FOUND = ROOT / "build" / "fuzz" / "found"
LONGEST = 1500  # bytes of an input
# how many inputs a bounded run tries: each some ten seconds on one processor
RUNS = {"options": 10_000, "schema": 8_000, "segment": 2_000, "lane": 6_000, "journal": 20_000}
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
        str(UNPACKED / name),
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
    corpus, found = UNPACKED / name, FOUND / name
    subprocess.run([program(name), *COMMON, "-merge=1", str(corpus), str(found)], check=True)
    print(f"fuzz_{name}: {pack(name, corpus)} inputs added to {archive_of(name)}")


def add(name: str, files: list[Path]) -> None:
    """Adds inputs to the corpus of a fuzzer as they are."""
    corpus = unpack(name)
    for file in files:
        shutil.copy(file, corpus)
    print(f"fuzz_{name}: {pack(name, corpus)} inputs added to {archive_of(name)}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("fuzzers", nargs="*", help=f"of {', '.join(RUNS)}; all by default")
    parser.add_argument(
        "--minutes", type=float, help="run each so long instead of a number of inputs"
    )
    parser.add_argument(
        "--merge", action="store_true", help="take finds into the corpus afterwards"
    )
    parser.add_argument(
        "--add", nargs="+", type=Path, metavar="FILE", help="only add these to one fuzzer's corpus"
    )
    arguments = parser.parse_args()
    unknown = set(arguments.fuzzers) - set(RUNS)
    if unknown:
        parser.error(f"no fuzzer {', '.join(sorted(unknown))}; there are {', '.join(RUNS)}")

    if arguments.add:
        if len(arguments.fuzzers) != 1:
            parser.error("--add needs the name of one fuzzer, before it")
        add(arguments.fuzzers[0], arguments.add)
        return 0
    build()

    def fuzz(name: str) -> tuple[int, int]:
        known = len(list(unpack(name).iterdir()))
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
