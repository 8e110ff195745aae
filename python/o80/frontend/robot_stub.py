"""Writes a typed module for a robot, with its names as literals and its fields as types."""

import ast
import copy
import hashlib
import inspect
import keyword
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from o80.base.errors import SchemaMismatch
from o80.base.finite import json_text
from o80.frontend.commander import Commander
from o80.frontend.frontend import Frontend, class_of
from o80.frontend.reader import Reader
from o80.rows import history
from o80.rows.layout import is_plain

# names of a segment are chosen by others: they are written in comments and literals, as their repr
HEAD = '''"""A robot for editors and type checkers: attach() attaches to it.

Make this module again when the robot has changed.
"""

# The robot {robot!r}, written by `o80 stub` for {segment!r}.
# Methods are narrower than those of o80.Frontend: they take the names of this robot only.
# mypy: disable-error-code="override, misc"
# pyright: reportIncompatibleMethodOverride=false
# ruff: noqa
# fmt: off

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import (
    TYPE_CHECKING,
    Any,
    Literal,
    Never,
    Self,
    SupportsIndex,
    TypeAlias,
    TypedDict,
    Unpack,
    cast,
    overload,
)

import numpy as np
import o80
import o80.stub
from numpy.typing import ArrayLike, NDArray
from o80.stub import Chunks, IdleWord, LateWord, ModeWord, OnErrorWord, ProfileWord, Range, RowsWord
from o80.stub import StartWord, Tolerance
{imports}
DESCRIBED = "{digest}"  # of what was described when this module was made

'''

TAIL = '''
else:
    {cls} = o80.Frontend


def attach(
    segment: str = {segment!r},
    timeout: float | None = 5.0,
    *,
    read_only: bool = False,
    on_error: OnErrorWord = "purge",
    dead: bool = False,
) -> {cls}:
    """Attaches to a segment of this robot, as `o80.Frontend` with the same arguments.

    Raises SchemaMismatch if the robot is not the one that this module describes.
    """
    opened = o80.Frontend(segment, timeout, read_only=read_only, on_error=on_error, dead=dead)
    o80.stub.check(opened, DESCRIBED)
    return cast({cls}, opened)
'''

#: names that the module uses itself
RESERVED = ("Row", "Rows", "RowStream", "Actuator", "Request", *re.findall(r"\b[A-Z]\w+", HEAD))

#: class of the module in place of a type of o80
ROW = {"_core.Observation": "Row", "History": "Rows", "_core.Stream": "RowStream"}
PLAIN = {name: f"o80.{name}" for name in ("PreparedBurst", "Preview")}


def module_of(schema: dict[str, Any], segment: str | None = None) -> str:
    """Returns the text of the typed module for a robot with this schema.

    segment: default segment of the module; None: the robot's name.
    """
    return "".join(Module(schema).parts(segment or schema["robot"]))


def _typed(described: Any) -> Any:
    """Removes units, helps and offsets from a description: types do not depend on them."""
    if isinstance(described, dict):
        left_out = ("unit", "help", "offset")
        return {name: _typed(each) for name, each in described.items() if name not in left_out}
    return [_typed(each) for each in described] if isinstance(described, list) else described


def digest_of(schema: dict[str, Any]) -> str:
    """Returns a hash of the names and types in a typed module, without limits or options."""
    named = [(each["name"], each["group"]) for each in schema["actuators"]]
    parts = [schema["groups"], schema.get("extended"), named]
    requests = [[each["name"], each["type"]] for each in schema["requests"]]
    text = json_text(_typed([*parts, requests]))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def check(opened: Frontend, digest: str) -> None:
    """Raises SchemaMismatch, and closes the frontend, if its robot has another digest."""
    if digest_of(opened.schema) == digest:
        return
    segment, robot = opened.segment, opened.robot
    opened.close()
    raise SchemaMismatch(
        f"'{segment}' runs the robot '{robot}', which is described differently than when the "
        f"module was made: make it again with `o80 stub {segment}`"
    )


def literal(words: Iterable[str]) -> str:
    """Returns the Literal type of the words; Never if there are none."""
    known = ", ".join(map(repr, words))
    return f"Literal[{known}]" if known else "Never"


def number_type(field: Mapping[str, Any]) -> str:
    """Returns the type of one number."""
    kinds = {"b": "bool", "i": "int", "u": "int", "f": "float"}
    return literal(field["labels"]) if field["kind"] == "enum" else kinds[field["kind"][0]]


def array_type(field: Mapping[str, Any]) -> str:
    """Returns the type of an array of numbers."""
    if field["kind"] == "enum":
        return "o80.stub.EnumerationArray"
    return f"NDArray[np.{field['kind']}{'_' if field['kind'] == 'bool' else ''}]"


def verbs_of(source: Path, cls: str) -> Iterator[ast.FunctionDef]:
    """Yields the public methods of a class in a file."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef) and node.name == cls:
            for inner in node.body:
                block = inner.body if isinstance(inner, ast.If) else [inner]
                for verb in block:
                    if isinstance(verb, ast.FunctionDef) and (
                        not verb.name.startswith("_") or verb.name == "__getitem__"
                    ):
                        yield verb


def changed(node: ast.expr | None, types: Mapping[str, str]) -> str:
    """Returns the text of an annotation with types of the module."""
    text = node.value if isinstance(node, ast.Constant) else ast.unparse(node) if node else "Any"
    for old, new in {**PLAIN, **types}.items():
        text = re.sub(rf"(?<![\w.]){re.escape(old)}\b", new, str(text))
    return str(text).replace("_core.", "o80.")


class Module:
    """The parts of a typed module."""

    def __init__(self, schema: dict[str, Any]) -> None:
        self._schema = schema
        self._classes: dict[str, str] = {}  # by name, in order
        robot = re.sub(r"\W", "_", schema["robot"])
        self._cls = "".join(word.title() for word in robot.split("_")) or "Robot"
        self._cls += "Frontend" if self._cls in RESERVED else ""
        self._cls = self._cls if self._cls.isidentifier() else f"Robot{self._cls}"
        self._names = {("", each): each for each in (*RESERVED, self._cls)}
        self._groups = schema["groups"]
        self._named: dict[int, list[str]] = {}
        for actuator in schema["actuators"]:
            self._named.setdefault(actuator["group"], []).append(actuator["name"])

    def parts(self, segment: str) -> Iterator[str]:
        """Yields the text, part by part."""
        base = class_of(self._schema["robot"]) or Frontend
        yield HEAD.format(
            robot=self._schema["robot"],
            segment=segment,
            digest=digest_of(self._schema),
            imports="" if base is Frontend else f"import {base.__module__}\n",
        )
        names = [each["name"] for each in self._schema["actuators"]]
        yield f"Actuator: TypeAlias = {literal(names)}\n"
        yield f"Request: TypeAlias = {literal(e['name'] for e in self._schema['requests'])}\n"
        yield "\nif TYPE_CHECKING:\n"
        one, many = self._states("one"), self._states("many")
        extended = self._schema.get("extended")
        sensors = [
            self._record(extended, how) if extended else "o80.Record" for how in ("one", "many")
        ]
        rows = self._row(one, sensors[0]) + self._rows(many, sensors[1])
        base_name = (
            f"{base.__module__}.{base.__qualname__}" if base is not Frontend else "o80.Frontend"
        )
        verbs = "\n".join(f"        {line}" for line in self._verbs(one))
        yield from self._classes.values()
        yield f"{rows}\n    class {self._cls}({base_name}):\n{verbs}\n"
        yield TAIL.format(cls=self._cls, segment=segment)

    # ------------------------------------------------------------------ values

    def _new_name(self, wanted: str, kind: str, key: str) -> tuple[str, bool]:
        """Returns the name of a class, and whether it is new."""
        if (kind, key) in self._names:
            return self._names[kind, key], False
        word = re.sub(r"\W", "_", wanted.rpartition("::")[2]) or "State"
        word = word[0].upper() + word[1:]
        name = word if word.isidentifier() and not keyword.iskeyword(word) else f"State{word}"
        taken = set(self._names.values())
        while name + kind in taken:
            name += "_"
        self._names[kind, key] = name + kind
        return name + kind, True

    def _record(self, described: dict[str, Any], how: str) -> str:
        """Returns the class of a record of one row, of many rows, or of an array of structs."""
        kind = {"one": "", "many": "Rows", "array": "Array"}[how]
        name, new = self._new_name(described["name"], kind, json_text(described))
        if new:
            fields = described["fields"]
            members = {field["name"]: self._value(field, how) for field in fields}
            self._classes[name] = self._class(name, members, how)
        return name

    def _class(self, name: str, members: dict[str, str], how: str) -> str:
        key = literal(members)
        if how == "array":
            places = "SupportsIndex | slice | tuple[Any, ...] | NDArray[Any] | None"
            lines = [
                f"    class {name}(np.ndarray[Any, np.dtype[Any]]):",
                f"        def __getitem__(self, key: {key} | {places}) -> Any: ...",
            ]
        else:
            lines = [f"    class {name}(Mapping[str, Any]):"]
            lines += [
                f"        {field}: {kind}"
                for field, kind in members.items()
                if field.isidentifier() and not keyword.iskeyword(field)
            ]
            lines += [
                f"        def __getitem__(self, name: {key}) -> Any: ...",
                "        def __iter__(self) -> Iterator[str]: ...",
                "        def __len__(self) -> int: ...",
            ]
        return "\n".join(lines) + "\n\n"

    def _value(self, field: dict[str, Any], how: str) -> str:
        """Returns the type of a field of a record."""
        if field["kind"] == "struct":
            return self._record(field["type"], "array" if field["shape"] else how)
        return number_type(field) if how == "one" and not field["shape"] else array_type(field)

    def _states(self, how: str) -> str:
        """Returns the type of the states of all actuators."""
        if not self._groups:
            return "o80.Record"
        if len(self._groups) == 1 and not self._groups[0]["name"]:
            return self._state(self._groups[0], how)
        members = {group["name"]: self._state(group, how) for group in self._groups}
        kind = "" if how == "one" else "Rows"
        name, _ = self._new_name("Actuators", kind, "")
        self._classes[name] = self._class(name, members, how)
        return name

    def _state(self, group: dict[str, Any], how: str) -> str:
        field = {"kind": "struct", "type": group["type"], "shape": []}
        if is_plain(group["type"]):
            field = group["type"]["fields"][0]
        return self._value(field | {"shape": field["shape"] or group["array"]}, how)

    def _row(self, states: str, sensors: str) -> str:
        return self._part("Row", "o80.Observation", states, sensors) + (
            "\n    class RowStream(o80.Stream):\n"
            "        def __iter__(self) -> Self: ...\n"
            "        def __next__(self) -> Row: ...\n"
        )

    def _rows(self, states: str, sensors: str) -> str:
        source = Path(inspect.getfile(history))
        verbs = [verb for verb in verbs_of(source, "History") if _returns(verb, ROW)]
        lines = [line for verb in verbs for line in self._verb(verb, {}, ROW)]
        text = "".join(f"        {line}\n" for line in lines)
        iterates = "        def __iter__(self) -> Iterator[Row]: ...\n"
        return "\n" + self._part("Rows", "o80.History", states, sensors) + text + iterates

    @staticmethod
    def _part(name: str, base: str, states: str, sensors: str) -> str:
        parts = {"desired": states, "observed": states, "extended": sensors}
        text = f"    class {name}({base}):\n"
        for part, kind in parts.items():
            text += f"        @property\n        def {part}(self) -> {kind}: ...\n"
        return text

    # ------------------------------------------------------------------ verbs

    def _verbs(self, states: str) -> Iterator[str]:
        """Yields lines of the frontend's methods whose types depend on the robot."""
        types = {**ROW, "States": states}
        found: dict[str, list[ast.FunctionDef]] = {}
        for cls in (Reader, Commander, Frontend):
            for verb in verbs_of(Path(inspect.getfile(cls)), cls.__name__):
                found.setdefault(verb.name, []).append(verb)
        for name, verbs in found.items():
            last = verbs[-1]
            takes = {each.arg for each in [*last.args.posonlyargs, *last.args.args]}
            if name in ("request", "add_request"):
                yield from self._requests(last)
            elif takes & {"actuator", "actuators"}:
                uses = self._uses(last, takes)
                yield from _overloaded([self._verb(last, each, types) for each in uses])
            elif _returns(last, types):
                for verb in verbs:
                    yield from self._verb(verb, {}, types)

    def _uses(self, verb: ast.FunctionDef, takes: set[str]) -> Iterator[dict[str, str]]:
        """Yields the ways to call a method of actuators: types by argument, for each way."""
        all_of_them = "Actuator | SupportsIndex"
        several = f"{all_of_them} | Sequence[{all_of_them}] | None"
        if verb.args.defaults:  # without a target for it
            yield {"actuator": f"{all_of_them} | None", "actuators": several}
            return
        target = "target" if "target" in takes else "targets"
        actuator = "actuator" if "actuator" in takes else "actuators"
        kinds: dict[str, list[str]] = {}
        for index, group in enumerate(self._groups):
            names = self._named.get(index, [])
            kinds.setdefault(self._target(group["type"]), []).extend(names)
        for kind, names in kinds.items():
            yield {actuator: literal(names), target: kind}
        yield {actuator: "SupportsIndex", target: "Any"}
        yield {actuator: f"Sequence[{all_of_them}] | None", target: "Any"}

    def _target(self, described: dict[str, Any]) -> str:
        """Returns the type of a target."""
        fields = described["fields"]
        if is_plain(described):
            return self._given(fields[0])
        name, new = self._new_name(described["name"], "Target", json_text(described))
        if new:
            members = ", ".join(f"{field['name']!r}: {self._given(field)!r}" for field in fields)
            text = f'    {name} = TypedDict("{name}", {{{members}}}, total=False)\n\n'
            self._classes[name] = text
        first = f"{self._given(fields[0])} | " if fields else ""
        return f"{first}{name} | Sequence[Any] | np.void | o80.Record"

    def _given(self, field: dict[str, Any]) -> str:
        """Returns the type of a number that is sent."""
        if field["kind"] == "struct":
            return "Any"
        if field["shape"]:
            return "Any" if field["kind"] == "enum" else "ArrayLike"
        return f"{number_type(field)} | int" if field["kind"] == "enum" else number_type(field)

    def _requests(self, verb: ast.FunctionDef) -> Iterator[str]:
        uses = []
        for request in self._schema["requests"]:
            called = copy.deepcopy(verb)
            arguments, fields = called.args, request["type"]["fields"]
            taken = {each.arg for each in [*arguments.posonlyargs, *arguments.kwonlyargs]}
            if all(_is_argument(field["name"], taken) for field in fields):
                arguments.kwarg = None
                for field in fields:
                    kind = ast.parse(self._given(field), mode="eval").body
                    arguments.kwonlyargs.append(ast.arg(field["name"], kind))
                    default = ast.Constant(...) if "default" in field else None
                    arguments.kw_defaults.append(default)
            lines = self._verb(called, {"name": literal([request["name"]])}, ROW)
            uses.append([*lines, *(f"    # {line}" for line in request["help"].splitlines())])
        yield from _overloaded(uses or [self._verb(verb, {"name": "Never"}, ROW)])

    def _verb(
        self, verb: ast.FunctionDef, arguments: Mapping[str, str], types: Mapping[str, str]
    ) -> list[str]:
        """Returns the lines of a method with other types."""
        given = copy.deepcopy(verb.args)
        for each in [*given.posonlyargs, *given.args, *given.kwonlyargs]:
            if each.annotation is not None:
                text = arguments.get(each.arg) or changed(each.annotation, {})
                each.annotation = ast.parse(text, mode="eval").body
        returns = changed(verb.returns, types)
        marks = [ast.unparse(mark) for mark in verb.decorator_list]
        marks = [f"@{mark}" for mark in marks if mark in ("overload", "property")]
        return [*marks, f"def {verb.name}({ast.unparse(given)}) -> {returns}: ..."]


def _returns(verb: ast.FunctionDef, types: Mapping[str, str]) -> bool:
    """True if the result has another type in a module."""
    return changed(verb.returns, types) != changed(verb.returns, {})


def _is_argument(name: str, taken: set[str]) -> bool:
    return name.isidentifier() and not keyword.iskeyword(name) and name not in {*taken, "self"}


def _overloaded(uses: list[list[str]]) -> Iterator[str]:
    """Yields the lines of a method with these overloads."""
    for use in uses:
        yield from ["@overload", *use] if len(uses) > 1 else use
    if len(uses) > 1:
        name = next(line for line in uses[0] if line.startswith("def ")).partition("(")[0]
        yield f"{name}(self, *given: Any, **named: Any) -> Any: ..."
