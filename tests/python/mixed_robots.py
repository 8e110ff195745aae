"""Draws robots with states and sensors of random types."""

import itertools
import os
from enum import IntEnum
from typing import Any

import numpy as np
from hypothesis import HealthCheck, Phase, settings
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


def fill(random: np.random.Generator, array: np.ndarray[Any, np.dtype[Any]]) -> None:
    """Fills every field at random with 0 or 3, which all types hold, and Mode has labels for."""
    if array.dtype.names is None:
        array[...] = random.choice([0, 3], array.shape).astype(array.dtype)
        return
    for name in array.dtype.names:
        fill(random, array[name])


_names = (f"test-mixed-{os.getpid()}-{i}" for i in itertools.count())


def recorded(groups: Any, sensors: Any, seed: int, rows: int = 5) -> o80.History:
    """Returns rows published by a robot of these types."""
    random = np.random.default_rng(seed)
    name = next(_names)
    options: Any = {"extended": sensors, "bursting": True}
    with o80.Backend(name, groups, **options) as backend:
        backend.publish(_random(random, backend._observed), _random(random, backend._extended))
        with o80.Frontend(name) as frontend:
            for row in range(rows):
                if row > 0:
                    burst = frontend.burst(1, wait=False)
                    backend.step()
                backend.publish(
                    _random(random, backend._observed), _random(random, backend._extended)
                )
            assert rows == 1 or burst.done
            history = frontend.history()
    o80.clean(name)
    return history


def _random(random: np.random.Generator, like: Any) -> Any:
    array = np.array(like)
    if array.dtype.itemsize == 0:
        return None
    fill(random, array)
    return array


# each example starts a backend: shrinking would exceed a test's timeout
ROBOTS = settings(
    max_examples=12,
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)
