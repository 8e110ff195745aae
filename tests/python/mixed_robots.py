"""Draws robots with states and sensors of random types."""

import itertools
import os
from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np
from hypothesis import Phase, settings
from hypothesis import strategies as st

import o80


class Mode(IntEnum):
    IDLE = 0
    MOVE = 3
    HOLD = -2


KINDS = ["f8", "f4", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "?"]
NUMBERS = st.sampled_from(KINDS).map(np.dtype)
SHAPED = st.builds(
    lambda kind, shape: (kind, shape) if shape else kind,
    NUMBERS,
    st.lists(st.integers(1, 3), max_size=2).map(tuple),
)
NAMES = st.sampled_from(["position", "velocity", "force", "count", "on", "mode"])
STRUCT_ARRAYS = st.builds(
    lambda fields, shape: (np.dtype(list(fields.items())), shape),
    st.dictionaries(NAMES, NUMBERS, min_size=1, max_size=3),
    st.lists(st.integers(1, 3), min_size=1, max_size=2).map(tuple),
)
FIELDS = st.one_of(SHAPED, st.just(Mode), STRUCT_ARRAYS)
STRUCTS = st.dictionaries(NAMES, FIELDS, min_size=1, max_size=4)
STATES = st.one_of(NUMBERS, st.just(Mode), STRUCTS, st.fixed_dictionaries({"inner": STRUCTS}))
GROUPS = st.dictionaries(
    st.sampled_from(["joints", "gripper", "wheels"]),
    st.one_of(STATES, st.tuples(STATES, st.integers(1, 3))),
    min_size=1,
    max_size=3,
)
SENSORS = st.one_of(st.none(), STRUCTS)


def is_enum(described: Any) -> bool:
    return isinstance(described, type) and issubclass(described, IntEnum)


def drawn(random: np.random.Generator, described: Any, lead: tuple[int, ...] = ()) -> Any:
    """Draws values of a type: a mapping for a struct, an array (*lead, ...) otherwise."""
    if isinstance(described, Mapping):
        return {name: drawn(random, inner, lead) for name, inner in described.items()}
    if is_enum(described):
        return random.choice([*described], lead).astype(np.int64)
    element, shape = np.dtype(described).subdtype or (np.dtype(described), ())
    if element.names is not None:
        kinds = [(name, element.fields[name][0]) for name in element.names]  # without padding
        values = np.zeros((*lead, *shape), kinds)
        for name, kind in kinds:
            values[name] = drawn(random, kind, values.shape)
        return values
    if element.kind == "f":
        return random.normal(size=(*lead, *shape)).astype(element)
    low, high = (0, 1) if element.kind == "b" else (np.iinfo(element).min, np.iinfo(element).max)
    dtype = np.uint8 if element.kind == "b" else element
    return random.integers(low, high, (*lead, *shape), dtype, endpoint=True).astype(element)


def many(members: Any) -> tuple[Any, tuple[int, ...]]:
    """Returns a group's type and (count,), or () for a single actuator."""
    if not isinstance(members, tuple):
        return members, ()
    return members[0], (members[1] if isinstance(members[1], int) else len(members[1]),)


class Drawn:
    """Endless list of random rows of a robot with described types."""

    def __init__(self, groups: Mapping[str, Any], sensors: Any, seed: int) -> None:
        self.groups, self.sensors = groups, sensors
        self._random = np.random.default_rng(seed)
        self._rows: list[tuple[Any, Any]] = []

    def row(self, number: int) -> tuple[Any, Any]:
        """Returns states and sensor values of a row, for `Backend.publish`."""
        while len(self._rows) <= number:
            states = {
                name: drawn(self._random, *many(members)) for name, members in self.groups.items()
            }
            sensors = None if self.sensors is None else drawn(self._random, self.sensors)
            self._rows.append((states, sensors))
        return self._rows[number]


_names = (f"test-mixed-{os.getpid()}-{i}" for i in itertools.count())


def recorded(groups: Any, sensors: Any, seed: int, rows: int = 5) -> o80.History:
    """Returns rows published by a robot of these types."""
    name, drawn_rows = next(_names), Drawn(groups, sensors, seed)
    with o80.Backend(name, groups, extended=sensors, bursting=True) as backend:
        backend.publish(*drawn_rows.row(0))
        with o80.Frontend(name) as frontend:
            for row in range(1, rows):
                frontend.burst(1, wait=False)
                backend.step()
                backend.publish(*drawn_rows.row(row))
            history = frontend.history()
    o80.clean(name)
    return history


# each example starts a backend: shrinking would exceed a test's timeout
ROBOTS = settings(
    max_examples=12,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
)
