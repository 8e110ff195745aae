"""Measures the tests by random faults in the sources, one active in each run.

    python tools/mutants.py TREE --count 60 --seed 1                  # edits a copy of the tree
    python tools/mutants.py TREE --table TABLE --cpp 'build/dev/bin/o80_test_control' \\
        --python 'pytest -x -q -m "not check" {tests}'                # runs the tests of that copy

TREE then holds all mutants; O80_MUTANT=<number> activates one, so TREE is built once. If a mutant
does not compile, copy the tree again and draw `--without` its number. The second form runs the
commands for each mutant until a test fails, and adds a row to TABLE.
"""

import argparse
import ast
import json
import os
import random
import re
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

PLACES = ("src/control", "src/runtime", "python/o80")
PAIRS = ["< <=", "> >=", "== !=", "+ -", "&& ||", "0 1", "true false"]
SWAPS = dict(p for a, b in map(str.split, PAIRS) for p in ((a, b), (b, a)))
TOKEN = re.compile(
    r"(?<= )(?:[<>]=?|[=!]=|[+-]|&&|\|\|)(?= )|(?<![\w.])(?:[01]|true|false)(?![\w.])"
)
VALUE = re.compile(
    r"\breturn ([^;{}\"]+);|^ +(?!.*(?:constexpr|static|using))[^\n({]* [+-]?= ([^;{}\"]+);", re.M
)
STATEMENT = re.compile(
    r"^ +((?:(?!if|for|while|return|assert|static_assert)[a-z][\w.>:\[\]-]*\([^;]*\)"
    r"|[a-z][\w.>\[\]-]* [+-]?= [^;{}\"]+|(?:\+\+|--)[\w.]+));",
    re.M,
)
OPPOSITE = {ast.Lt: ast.LtE, ast.Gt: ast.GtE, ast.Eq: ast.NotEq, ast.Is: ast.IsNot}
OPPOSITE |= {ast.In: ast.NotIn} | {value: key for key, value in OPPOSITE.items()}
HELPER = """#pragma once
#include <cstdlib>
inline bool o80_mutant_chosen(int number) {
  static const int chosen = std::getenv("O80_MUTANT") ? std::atoi(std::getenv("O80_MUTANT")) : 0;
  return chosen == number;
}
constexpr bool o80_mutant(int number) {
  return __builtin_is_constant_evaluated() ? false : o80_mutant_chosen(number);
}
"""
IN_PYTHON = '__import__("os").environ.get("O80_MUTANT") == "#"'


class Mutant(NamedTuple):
    file: str
    line: int
    function: str
    begin: int  # bytes of the edited text
    end: int
    text: str  # replacement; `#` becomes the number
    what: str


def in_cpp(file: str, source: str) -> Iterator[Mutant]:
    def mutant(begin: int, end: int, text: str, what: str) -> Mutant:
        above = re.findall(r"(\w+)\([^;]*\)[^;()]*\{", source[max(0, begin - 3000) : begin])
        line = source.count("\n", 0, begin) + 1
        start = len(source[:begin].encode())
        stop = len(source[:end].encode())
        return Mutant(file, line, (above or [""])[-1], start, stop, text, " ".join(what.split()))

    def edited(begin: int, end: int, others: list[str]) -> Iterator[Mutant]:
        value = source[begin:end]
        for found in TOKEN.finditer(value):
            others += [value[: found.start()] + SWAPS[found[0]] + value[found.end() :]]
        for other in others:
            text = f"(o80_mutant(#) ? ({other}) : ({value}))"
            yield mutant(begin, end, text, f"{value} -> {other}")

    for found in re.finditer(r"\b(?:if|while) \(", source):
        end, depth = found.end(), 1
        while depth:
            depth += {"(": 1, ")": -1}.get(source[end], 0)
            end += 1
        condition = source[found.end() : end - 1]
        if not re.search(r"[;{]| = ", condition):
            yield from edited(found.end(), end - 1, [f"!({condition})"])
    for found in VALUE.finditer(source):
        yield from edited(*found.span(1 if found[1] else 2), [])
    for found in STATEMENT.finditer(source):
        text = f"o80_mutant(#) ? void() : static_cast<void>({found[1]})"
        yield mutant(*found.span(1), text, f"left out: {found[1]}")


def in_python(file: str, source: str) -> Iterator[Mutant]:
    starts = [0]
    for row in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(row))

    def mutant(node: ast.expr | ast.stmt, new: ast.expr | None, function: str) -> Mutant:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + node.end_col_offset
        old = source.encode()[begin:end].decode()
        text = f"if {IN_PYTHON.replace('==', '!=')}: {old}"
        what = f"left out: {old}"
        if new is not None:
            text = f"(({ast.unparse(new)}) if {IN_PYTHON} else ({old}))"
            what = f"{ast.unparse(node)} -> {ast.unparse(new)}"
        return Mutant(file, node.lineno, function, begin, end, text, " ".join(what.split()))

    def of(node: ast.AST, function: str) -> Iterator[Mutant]:
        match node:
            case ast.Compare(left, [op], right) if type(op) in OPPOSITE:
                yield mutant(node, ast.Compare(left, [OPPOSITE[type(op)]()], right), function)
            case ast.BinOp(left, ast.Add() | ast.Sub() as op, right):
                texts = (ast.JoinedStr, ast.List, ast.Tuple)
                if not any(isinstance(x, texts) or "'" in ast.unparse(x) for x in (left, right)):
                    other = ast.Sub() if isinstance(op, ast.Add) else ast.Add()
                    yield mutant(node, ast.BinOp(left, other, right), function)
            case ast.BoolOp(op, values):
                other_op = ast.Or() if isinstance(op, ast.And) else ast.And()
                yield mutant(node, ast.BoolOp(other_op, values), function)
            case ast.If(test) | ast.While(test) | ast.IfExp(test):
                yield mutant(test, ast.UnaryOp(ast.Not(), test), function)
            case ast.Constant(bool() as value):
                yield mutant(node, ast.Constant(not value), function)
            case ast.Constant(0 | 1 as value):
                yield mutant(node, ast.Constant(0 if value == 1 else 1), function)
            case ast.Return(ast.expr() as value) if not isinstance(value, ast.Constant):
                yield mutant(value, ast.Constant(None), function)
            case ast.Expr(ast.Call()) | ast.AugAssign():
                yield mutant(node, None, function)
            case ast.Assign([ast.Attribute() | ast.Subscript()]):
                yield mutant(node, None, function)

    def below(node: ast.AST, function: str) -> Iterator[Mutant]:
        if isinstance(node, ast.JoinedStr | ast.arguments | ast.match_case):
            return
        if function:
            yield from of(node, function)
        inside: Iterable[ast.AST] = ast.iter_child_nodes(node)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            inside, function = node.body, node.name
        for child in inside:
            yield from below(child, function)

    yield from below(ast.parse(source), "")


def write(tree: Path, count: int, seed: int, without: list[int]) -> None:
    """Draws mutants without overlaps, and edits the tree."""
    sites = {".cpp": in_cpp, ".hpp": in_cpp, ".py": in_python}
    found: list[Mutant] = []
    for path in sorted(x for place in PLACES for x in (tree / place).rglob("*")):
        if path.suffix in sites:
            found += sites[path.suffix](str(path.relative_to(tree)), path.read_text())
    random.Random(seed).shuffle(found)
    drawn: list[Mutant] = []
    for one in found:
        beside = (x for x in drawn if x.file == one.file)
        if all(one.end <= x.begin or x.end <= one.begin for x in beside):
            drawn.append(one)
        if len(drawn) == count + len(without):
            break
    kept = {n: one for n, one in enumerate(drawn, 1) if n not in without}
    for number, one in sorted(kept.items(), key=lambda pair: -pair[1].begin):
        old, new = (tree / one.file).read_bytes(), one.text.replace("#", str(number)).encode()
        (tree / one.file).write_bytes(old[: one.begin] + new + old[one.end :])
    for file in {one.file for one in kept.values() if not one.file.endswith(".py")}:
        (tree / file).write_text('#include "o80/base/mutant.hpp"\n' + (tree / file).read_text())
    (tree / "include/o80/base/mutant.hpp").write_text(HELPER)
    (tree / "mutants.json").write_text(json.dumps(kept, indent=1))
    print(f"{len(kept)} mutants of {len(found)}")


def likely_first(tree: Path, one: Mutant) -> str:
    """Sorts tests/python: first the files that name the mutant's module or function most."""
    words = re.compile(rf"\b_?(?:{Path(one.file).stem.strip('_')}|{one.function.strip('_')})\b")
    files = sorted((tree / "tests/python").rglob("test_*.py"))
    files.sort(key=lambda file: -len(words.findall(file.read_text())))
    return " ".join(str(file.relative_to(tree)) for file in files)


def killer(tree: Path, number: str, command: str, timeout: float) -> str:
    """Runs a command; returns the failed test, or nothing."""
    limited = ["timeout", "--signal=KILL", str(timeout), "sh", "-c", command]
    mutated = {**os.environ, "O80_MUTANT": number, "GTEST_FAIL_FAST": "1"}
    done = subprocess.run(limited, cwd=tree, env=mutated, capture_output=True)
    if done.returncode == 0:
        return ""
    output = (done.stdout + done.stderr).decode(errors="replace")
    failed = re.findall(r"^(?:FAILED|ERROR|\[  FAILED  \]) ([^\s,]+)", output, re.M)
    began = re.findall(r"^\[ RUN +\] (\S+)", output, re.M)
    return failed[0] if failed else f"ended with {done.returncode}: {(began or [command[:60]])[-1]}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("tree", type=Path)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--without", type=int, nargs="*", default=[])
    parser.add_argument("--only", nargs="*", help="numbers of the mutants to run")
    parser.add_argument("--table", type=Path)
    parser.add_argument("--cpp", action="append", default=[], help="for mutants in C++")
    parser.add_argument("--python", action="append", default=[], help="for all mutants")
    parser.add_argument("--timeout", type=float, default=900, help="of a command [s]")
    given = parser.parse_args()
    if given.table is None:
        return write(given.tree, given.count, given.seed, given.without)
    for number, fields in json.loads((given.tree / "mutants.json").read_text()).items():
        one = Mutant(*fields)
        if given.only and number not in given.only:
            continue
        commands = [] if one.file.endswith(".py") else [*given.cpp]
        commands += [x.replace("{tests}", likely_first(given.tree, one)) for x in given.python]
        killers = (killer(given.tree, number, each, given.timeout) for each in commands)
        with given.table.open("a") as table:
            by = next(filter(None, killers), "survived")
            table.write(f"| {number} | {one.file}:{one.line} | `{one.what}` | {by} |\n")


if __name__ == "__main__":
    main()
