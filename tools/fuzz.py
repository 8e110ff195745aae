"""Builds the fuzzers, replays what they ever found, and runs each of them further.

The corpus in tests/fuzz/corpus holds an input for each thing that can happen, those that once
broke something among them. New finds go to build/fuzz/found/<fuzzer>; `--merge` takes what is new
and small from there into the corpus.
"""

import argparse
import os
import subprocess
import sys

from sources import ROOT

BUILD = ROOT / "build" / "fuzz"
CORPUS = ROOT / "tests" / "fuzz" / "corpus"
LONGEST = 1500  # bytes of an input
# how many inputs a bounded run tries: each some ten seconds on one processor
RUNS = {"options": 20_000, "schema": 20_000, "segment": 5_000, "lane": 15_000}
COMMON = [
    f"-max_len={LONGEST}",
    "-len_control=0",
    "-timeout=600",  # of the wall clock: a hang, not a busy machine
    "-rss_limit_mb=2500",
    "-print_final_stats=1",
]


def build() -> None:
    """Compiles the core and the fuzzers with clang and its sanitizers."""
    jobs = str(len(os.sched_getaffinity(0)))
    options = {
        "CMAKE_BUILD_TYPE": "RelWithDebInfo",
        "CMAKE_CXX_FLAGS_RELWITHDEBINFO": "-O1",
        "CMAKE_CXX_COMPILER": "clang++-19",
        "O80_BUILD_FUZZERS": "ON",
        "O80_BUILD_MUJOCO": "OFF",
        "O80_CCACHE": "ON",
        "O80_WERROR": "ON",
        "Python_EXECUTABLE": sys.executable,
    }
    configure = ["cmake", "-S", str(ROOT), "-B", str(BUILD), "-G", "Ninja"]
    subprocess.run([*configure, *(f"-D{name}={options[name]}" for name in options)], check=True)
    compile_all = ["cmake", "--build", str(BUILD), "--target", "fuzzers", "-j", jobs]
    subprocess.run(compile_all, check=True)


def fuzzer(name: str, *arguments: str) -> list[str]:
    """The command that runs one; what breaks it is kept beside its finds."""
    found = BUILD / "found" / name
    found.mkdir(parents=True, exist_ok=True)
    return [
        str(BUILD / "bin" / f"fuzz_{name}"),
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
        raise SystemExit(f"fuzz_{name} broke: the input lies in {BUILD / 'found' / name}")
    return executed(result.stderr)


def merge(name: str) -> None:
    """Adds finds that reach something new to the corpus."""
    corpus = CORPUS / name
    corpus.mkdir(parents=True, exist_ok=True)
    program = str(BUILD / "bin" / f"fuzz_{name}")
    found = str(BUILD / "found" / name)
    subprocess.run([program, *COMMON, "-merge=1", str(corpus), found], check=True)


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
    total = replayed = 0
    names = arguments.fuzzers or list(RUNS)
    for name in names:
        inputs = len(list((CORPUS / name).iterdir()))
        replayed += inputs
        if arguments.minutes:
            count = run(name, f"-max_total_time={round(60 * arguments.minutes)}")
        else:
            count = run(name, f"-runs={RUNS[name] + inputs}", "-seed=1")
        total += count
        print(f"fuzz_{name}: {count} inputs, {inputs} of them known", flush=True)
        if arguments.merge:
            merge(name)
    print(f"{len(names)} fuzzers, {replayed} known inputs, {total} tried: nothing broke")
    return 0


if __name__ == "__main__":
    sys.exit(main())
