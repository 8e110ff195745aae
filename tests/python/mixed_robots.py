"""Robots whose states and sensors are of any described type, drawn at random."""

from enum import IntEnum
from typing import Any

import numpy as np
from hypothesis import strategies as st


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
FIELDS = st.one_of(SHAPED, st.just(Mode))
NAMES = st.sampled_from(["position", "velocity", "force", "count", "on", "mode"])
STRUCTS = st.dictionaries(NAMES, FIELDS, min_size=1, max_size=4)
STATES = st.one_of(NUMBERS, st.just(Mode), STRUCTS, st.fixed_dictionaries({"inner": STRUCTS}))
GROUPS = st.dictionaries(
    st.sampled_from(["joints", "gripper", "wheels"]),
    st.one_of(STATES, st.tuples(STATES, st.integers(1, 3))),
    min_size=1,
    max_size=3,
)
SENSORS = st.one_of(st.none(), STRUCTS)


def fill(random: np.random.Generator, array: np.ndarray[Any, np.dtype[Any]]) -> None:
    """Random numbers in every field: those that every type can hold, and Mode has labels for."""
    if array.dtype.names is None:
        array[...] = random.choice([0, 3], array.shape).astype(array.dtype)
        return
    for name in array.dtype.names:
        fill(random, array[name])
