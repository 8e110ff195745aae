"""The options of a driver in Python: the fields of its Config, a dataclass."""

import dataclasses
import typing
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any, Literal, NewType, get_args, get_origin

import o80._core as _core
from o80.base.errors import InvalidArgument

Seed = NewType("Seed", int)
"""A field of this type gets a random seed at each start, unless given; it is recorded."""

SEED_KIND = "seed"
DRAWN = "drawn at each start"
YES, NO = ("true", "1", "yes", "True"), ("false", "0", "no", "False")
TRUTH = {**dict.fromkeys(YES, True), **dict.fromkeys(NO, False)}


def option(default: Any, help: str = "", unit: str = "") -> Any:
    """Makes a field of a Config with a text for `--help`, and a unit such as "rad/s"."""
    metadata = {"help": help, "unit": unit}
    if isinstance(default, list):
        return dataclasses.field(default_factory=lambda: list(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True)
class Kind:
    """A type of options, with its parser."""

    name: str  #: number, integer, boolean, text, "one of: a, b", "3 x number", or seed
    parse: Callable[[str], Any]  #: raises ValueError
    text: Callable[[Any], str] = str


@dataclasses.dataclass(frozen=True)
class Options:
    """The options of a driver class."""

    config: type[Any] | None
    kinds: dict[str, Kind]
    rows: list[list[str]]  #: name, kind, default, help and unit of each

    @classmethod
    def of(cls, driver: type[Any]) -> "Options":
        """Reads the options of a driver's `Config`. Raises InvalidArgument for a wrong field."""
        config = getattr(driver, "Config", None)
        if config is None:
            return cls(None, {}, [])
        if not (isinstance(config, type) and dataclasses.is_dataclass(config)):
            raise InvalidArgument(
                f"{driver.__name__}.Config must be a dataclass: write @dataclass above it"
            )
        hints = typing.get_type_hints(config)
        kinds, rows = {}, []
        for field in dataclasses.fields(config):
            if not field.init:
                continue
            name = f"{driver.__name__}.Config.{field.name}"
            kinds[field.name] = kind = kind_of(hints[field.name], _default(field), name)
            otherwise = DRAWN if kind.name == SEED_KIND else kind.text(_default(field))
            about = field.metadata
            rows.append(
                [field.name, kind.name, otherwise, about.get("help", ""), about.get("unit", "")]
            )
        return cls(config, kinds, rows)

    def values(self, texts: Sequence[tuple[str, str]]) -> dict[str, Any]:
        """Parses texts of options. Raises InvalidArgument for an unknown option or a wrong text."""
        values = {}
        for name, text in texts:
            if name not in self.kinds:
                instead = _core.names_instead(name, list(self.kinds))
                raise InvalidArgument(f"there is no option '{name}'{instead}")
            kind = self.kinds[name]
            try:
                values[name] = kind.parse(text)
            except ValueError:
                raise InvalidArgument(
                    f"option '{name}' must be {_with_article(kind.name)}, got '{text}'"
                ) from None
        return values


def _default(field: dataclasses.Field[Any]) -> Any:
    if field.default is not dataclasses.MISSING:
        return field.default
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    raise InvalidArgument(
        f"option '{field.name}' has no default: give the field of Config one, because every "
        "robot can be started without options"
    )


def kind_of(annotation: Any, default: Any, name: str) -> Kind:
    """Returns the kind of an option. Raises InvalidArgument for a type that cannot be one."""
    simple = _simple_kind(annotation)
    if simple is not None:
        return simple
    if get_origin(annotation) in (list, tuple) and isinstance(default, (list, tuple)):
        elements = [each for each in get_args(annotation) if each is not Ellipsis]
        element = _simple_kind(elements[0]) if len(set(elements)) == 1 else None
        if element is not None and default:
            return _several(element, len(default), get_origin(annotation))
    raise InvalidArgument(
        f"{name} must be a float, an int, a bool, a str, a Path, an Enum, a Literal of texts, a "
        f"Seed, or a list or tuple of one of them with a default of its length; it is {annotation}"
    )


def _simple_kind(annotation: Any) -> Kind | None:
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        labels = ", ".join(annotation.__members__)
        return Kind(f"one of: {labels}", _one_of(annotation.__members__), lambda v: v.name)
    if get_origin(annotation) is Literal and all(isinstance(w, str) for w in get_args(annotation)):
        words = get_args(annotation)
        return Kind(f"one of: {', '.join(words)}", _one_of({word: word for word in words}))
    return _SIMPLE.get(annotation)


def _several(element: Kind, count: int, make: Any) -> Kind:
    def parse(text: str) -> Any:
        parts = text.split(",")
        if len(parts) != count:
            raise ValueError(text)
        return make(element.parse(part) for part in parts)

    return Kind(
        f"{count} x {element.name}", parse, lambda values: ",".join(map(element.text, values))
    )


def _seed(text: str) -> int:
    value = int(text)
    if not 0 <= value < 2**64:
        raise ValueError(text)
    return value


def _one_of(known: Mapping[str, Any]) -> Callable[[str], Any]:
    """Makes a parser for these words."""

    def parse(text: str) -> Any:
        if text not in known:
            raise ValueError(text)
        return known[text]

    return parse


_SIMPLE = {
    Seed: Kind(SEED_KIND, _seed),
    bool: Kind("boolean", _one_of(TRUTH), lambda value: "true" if value else "false"),
    int: Kind("integer", int),
    float: Kind("number", float, lambda value: repr(float(value))),
    str: Kind("text", str),
    Path: Kind("text", Path),
}


def _with_article(kind: str) -> str:
    if kind == SEED_KIND:
        return "a whole number, at least 0"
    if kind.startswith("one of") or kind[0].isdigit():
        return kind
    return f"an {kind}" if kind == "integer" else f"a {kind}"
