"""Checks the models of the memory layer, and that each of them can find something.

    tests/proofs/run.py models [--long] [name ...]

memory/*.cpp    the product's own sources under Relacy: all that the C++ memory model allows
protocol/*.pml  transcriptions for spin: every order of steps, with deaths between any two

A model must hold, and each of its mutants, an error put in on purpose, must be found.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

from checkout import ROOT

MODELS = Path(__file__).resolve().parent
BUILD = ROOT / "build" / "models"

JOBS = len(os.sched_getaffinity(0))


@dataclass(frozen=True)
class Verdict:
    """Verdict of a checker: whether the model held, how far it looked, and all it printed."""

    holds: bool
    looked: str
    output: str


@dataclass
class Model:
    name: str
    check: Callable[[], Verdict]
    mutants: dict[str, Callable[[], Verdict]] = field(default_factory=dict)


class BrokenModelError(Exception):
    """A model that does not fit the product any more."""


def run(command: list[str], folder: Path, *, must_pass: bool = True) -> str:
    result = subprocess.run(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if must_pass and result.returncode != 0:
        raise BrokenModelError(f"{' '.join(command)}\n{result.stdout}")
    return result.stdout


def fresh(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


# ------------------------------------------------------------------------------ memory


@dataclass(frozen=True)
class Mutant:
    """Edits of one file of the product; blanks and ends of lines count as one blank."""

    name: str
    file: str
    edits: tuple[tuple[str, str], ...]

    def apply(self, text: str) -> str:
        for old, new in self.edits:
            pattern = r"\s+".join(re.escape(word) for word in old.split())
            text, count = re.subn(pattern, lambda _, new=new: new, text)  # type: ignore[misc]
            if count != 1:
                raise BrokenModelError(
                    f"mutant {self.name}: {self.file} has {count} times, not once:\n  {old}\n"
                    "The product has changed: change the mutant with it."
                )
        return text


def mutants_of(source: str) -> list[Mutant]:
    """Reads `// mutant <name>: <file>` and the lines `//   - <old>` `//   + <new>` below it."""
    mutants = []
    for name, file, body in re.findall(
        r"^// mutant (\w+): (\S+)\n((?://   [-+].*\n)+)", source, re.MULTILINE
    ):
        edits: list[list[list[str]]] = []
        before = "+"
        for sign, line in re.findall(r"^//   ([-+]) ?(.*)$", body, re.MULTILINE):
            if sign == "-" and before == "+":
                edits.append([[], []])
            edits[-1][sign == "+"].append(line)
            before = sign
        mutants.append(
            Mutant(name, file, tuple(("\n".join(old), "\n".join(new)) for old, new in edits))
        )
    return mutants


class Relacy:
    """Compiles models together with the sources of the product, or with a mutant of them."""

    SOURCES = (
        "src/base/printable.cpp",
        "src/memory/segment/halt_word.cpp",
        "src/memory/ring/history.cpp",
        "src/memory/ring/journal.cpp",
        "src/memory/ring/lane_receiver.cpp",
        "src/memory/ring/lane_sender.cpp",
        "src/memory/segment/segment_file.cpp",
        "src/memory/segment/segment_layout.cpp",
        "src/memory/segment/signal.cpp",
    )
    FLAGS = ("-std=c++20", "-O1", "-w", "-fno-sized-deallocation")

    def __init__(self) -> None:
        # a copy: it stays one state of the sources while they are worked on
        self.product = fresh(BUILD / "product")
        shutil.copytree(ROOT / "include", self.product / "include")
        for layer in ("base", "memory"):
            shutil.copytree(ROOT / "src" / layer, self.product / "src" / layer)
        shutil.copytree(MODELS / "memory", self.product / "models")
        forced = self.product / "models" / "relacy_std.hpp"
        run(["g++", *self.FLAGS, "-x", "c++-header", str(forced)], self.product)
        self.forced = ["-include", str(forced)]

    def models(self, names: set[str], executions: int) -> list[Model]:
        found = {path.stem for path in self.product.glob("models/*.cpp")} - {"kernel"}
        found = found & names if names else found
        mains = [f"models/{name}.cpp" for name in sorted(found)]
        with ThreadPoolExecutor(JOBS) as pool:
            list(pool.map(self.compile, (*self.SOURCES, "models/kernel.cpp", *mains)))
        return [self.model(name, executions) for name in sorted(found)]

    def model(self, name: str, executions: int) -> Model:
        main = f"models/{name}.cpp"

        def check(mutant: Mutant | None = None) -> Verdict:
            program = self.link(main, mutant)
            # The order of executions depends on the machine, and a run ends at its first failure:
            # a mutant gets many, so that no machine misses one that fails once in thousands.
            count = max(executions // 4, 400_000) if mutant else executions
            output = run([str(program), "random", str(count)], BUILD, must_pass=False)
            last = output.rstrip().rpartition("\n")[2]
            number = re.fullmatch(r"(?:holds in|fails at) (\d+) executions", last)
            if number is None:
                # it broke down, which only a mutant may do
                return Verdict(False, "", output)
            return Verdict(last.startswith("holds"), f"{int(number[1]):,} executions", output)

        mutants = mutants_of((self.product / main).read_text())
        return Model(name, check, {m.name: lambda m=m: check(m) for m in mutants})  # type: ignore[misc]

    def compile(self, source: str, overlay: Path | None = None) -> Path:
        tree = overlay if overlay and (overlay / source).exists() else self.product
        place = overlay or self.product
        target = place / (source.replace("/", "_") + ".o")
        places = [overlay, self.product] if overlay else [self.product]
        includes = [
            f"-I{self.product}/models/stand_in",
            *(f"-I{p}/{folder}" for p in places for folder in ("src", "include")),
        ]
        command = ["g++", *self.FLAGS, *includes, *self.forced]
        run([*command, "-c", str(tree / source), "-o", str(target)], self.product)
        return target

    def link(self, main: str, mutant: Mutant | None) -> Path:
        overlay = None
        changed: tuple[str, ...] = ()
        if mutant:
            overlay = fresh(BUILD / f"{Path(main).stem}.{mutant.name}")
            file = overlay / mutant.file
            file.parent.mkdir(parents=True)
            file.write_text(mutant.apply((self.product / mutant.file).read_text()))
            is_header = mutant.file.endswith(".hpp")
            changed = (*self.SOURCES, "models/kernel.cpp", main) if is_header else (mutant.file,)
        objects = []
        for source in (*self.SOURCES, "models/kernel.cpp", main):
            known = self.product / (source.replace("/", "_") + ".o")
            build = source in changed
            objects.append(self.compile(source, overlay) if build else known)
        program = (overlay or self.product) / Path(main).stem
        run(["g++", *map(str, objects), "-o", str(program)], self.product)
        return program


# ------------------------------------------------------------------------------ protocol


class Spin:
    """Runs spin's verifier on a model, once for safety and once for each of its LTL formulas."""

    def models(self, names: set[str], *, long: bool) -> list[Model]:
        paths = sorted((MODELS / "protocol").glob("*.pml"))
        return [self.model(path, long=long) for path in paths if not names or path.stem in names]

    def model(self, path: Path, *, long: bool) -> Model:
        source = path.read_text()
        fair = ["-f"] if "(weak fairness)" in source else []
        claims = re.findall(r"^ltl (\w+)", source, re.MULTILINE)
        mutants = re.findall(r"^// mutant (\w+)", source, re.MULTILINE)

        def check(mutant: str = "") -> Verdict:
            folder = fresh(BUILD / f"{path.stem}.{mutant or 'true'}")
            defines = [f"-D{mutant}"] if mutant else []
            defines += ["-DLONG"] if long and not mutant else []
            # states compressed take half the memory and half as long again
            compressed = ["-DCOLLAPSE"] if long else []
            states = 0
            output = ""
            run(["spin", *defines, "-a", str(path)], folder)
            for claim in ("", *claims):
                options = ["-DSAFETY", "-DNOCLAIM"] if not claim else []
                run(["gcc", "-O1", "-w", *options, *compressed, "-DVECTORSZ=4096", "-DMEMLIM=3000",
                     "pan.c", "-o", "pan"], folder)  # fmt: skip
                arguments = ["-a", *fair, "-N", claim] if claim else []
                output = run(["./pan", "-m2000000", "-n", *arguments], folder, must_pass=False)
                if "max search depth too small" in output or "out of memory" in output:
                    return Verdict(False, "not looked at whole", output)
                found = re.search(r"errors: (\d+)", output)
                stored = re.search(r"([\d.e+]+) states, stored", output)
                states += int(float(stored[1])) if stored else 0
                if found is None or found[1] != "0":
                    return Verdict(False, f"{states:,} states", output)
            return Verdict(True, f"{states:,} states", output)

        return Model(path.stem, check, {m: lambda m=m: check(m) for m in mutants})  # type: ignore[misc]


# ------------------------------------------------------------------------------ all


class Trial:
    """A model and its mutants, being checked."""

    def __init__(self, model: Model, pool: ThreadPoolExecutor) -> None:
        self.model = model
        self.truth = pool.submit(model.check)
        self.tries = {name: pool.submit(check) for name, check in model.mutants.items()}


def judge(trial: Trial) -> list[str]:
    """Waits for the verdicts; what is wrong."""
    model, tries = trial.model, trial.tries
    verdict = trial.truth.result()
    wrong = []
    if not verdict.holds:
        wrong.append(f"{model.name} fails ({verdict.looked}):\n{verdict.output[-6000:]}")
    caught = 0
    for name, attempt in tries.items():
        try:
            if attempt.result().holds:
                wrong.append(f"{model.name}: nothing notices {name}")
            else:
                caught += 1
        except BrokenModelError as error:
            wrong.append(str(error))
    print(
        f"{model.name:12} {'holds' if verdict.holds else 'FAILS':6} {verdict.looked:>22}   "
        f"{caught} of {len(tries)} mutants caught",
        flush=True,
    )
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="models; all by default")
    parser.add_argument("--no-mutants", action="store_true", help="only the models themselves")
    parser.add_argument("--long", action="store_true", help="many more executions, larger models")
    arguments = parser.parse_args()
    names = set(arguments.names)
    BUILD.mkdir(parents=True, exist_ok=True)

    try:
        models = Relacy().models(names, 10_000_000 if arguments.long else 20_000)
        models += Spin().models(names, long=arguments.long)
        if arguments.no_mutants:
            models = [replace(model, mutants={}) for model in models]
        with ThreadPoolExecutor(JOBS) as pool:
            trials = [Trial(model, pool) for model in models]
            wrong = [line for trial in trials for line in judge(trial)]
    except BrokenModelError as error:
        print(error)
        return 1
    print(*wrong, sep="\n", end="\n" if wrong else "")
    mutants = sum(len(model.mutants) for model in models)
    if wrong:
        print(f"{len(wrong)} wrong of {len(models)} models and {mutants} mutants")
    else:
        print(f"{len(models)} models hold, {mutants} mutants caught")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
