"""Rows as messages: public decoders read every field, and the way back gives the same bytes."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from mixed_robots import GROUPS, ROBOTS, SENSORS, Mode, recorded
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import o80
from o80.recording.message_plan import MessagePlan
from o80.recording.message_types import SEPARATOR, MessageType, row_type


class Encoded:
    """A history as messages."""

    def __init__(self, history: o80.History) -> None:
        layout = history._layout
        self.type = row_type(layout)
        self.plan = MessagePlan(self.type, layout.size)
        self.rows = np.ascontiguousarray(history.rows).view(np.uint8).reshape(len(history), -1)
        self.messages = np.empty((len(history), self.plan.size), np.uint8)
        self.plan.encode(self.rows, self.messages)

    def decoded(self, row: int) -> Any:
        """By a public decoder, with the text of the type alone."""
        store = get_typestore(Stores.EMPTY)
        store.register(definitions(self.type))
        return store.deserialize_cdr(self.messages[row].tobytes(), f"o80/msg/{self.type.name}")


def definitions(message: MessageType) -> dict[str, Any]:
    first, *others = message.definition.split(SEPARATOR + "\n")
    found = get_types_from_msg(first, f"o80/msg/{message.name}")
    for each in others:
        name, text = each.removeprefix("MSG: ").split("\n", 1)
        found.update(get_types_from_msg(text, name.replace("/", "/msg/")))
    return found


def numbers(value: Any) -> list[Any]:
    """All numbers of a decoded message or of a NumPy value, in their order."""
    if isinstance(value, np.ndarray) and value.dtype.names is None:
        return value.ravel().tolist()
    if isinstance(value, (np.void, np.ndarray)) and value.dtype.names is not None:
        if isinstance(value, np.ndarray):
            return [number for each in value.ravel() for number in numbers(each)]
        return [number for name in value.dtype.names for number in numbers(value[name])]
    if isinstance(value, list):
        return [number for each in value for number in numbers(each)]
    if hasattr(value, "__dataclass_fields__"):
        fields = [name for name in value.__dataclass_fields__ if name.islower()]
        return [n for name in fields if name[0] != "_" for n in numbers(getattr(value, name))]
    return [value.item() if isinstance(value, np.generic) else value]


@ROBOTS
@given(GROUPS, SENSORS, st.integers(0, 2**32 - 1))
def test_a_public_decoder_reads_every_field_of_any_robot(
    groups: Any, sensors: Any, seed: int
) -> None:
    history = recorded(groups, sensors, seed)
    encoded = Encoded(history)
    for i in (0, len(history) - 1):
        message, row = encoded.decoded(i), history.rows[i]
        for part in ("desired", "observed", "extended"):
            if part in (history.rows.dtype.names or ()):
                assert repr(numbers(getattr(message, part))) == repr(numbers(row[part]))
        for head in ("iteration", "time", "lateness", "overruns", "skipped", "fresh", "halted"):
            assert getattr(message, head) == row[head]
        for mask in ("active", "clamped", "braking"):
            assert list(getattr(message, mask)) == list(getattr(history, mask)[i])


@ROBOTS
@given(GROUPS, SENSORS, st.integers(0, 2**32 - 1))
def test_decoded_rows_are_the_same_bytes(groups: Any, sensors: Any, seed: int) -> None:
    history = recorded(groups, sensors, seed)
    encoded = Encoded(history)

    assert np.array_equal(encoded.plan.decode(encoded.messages), encoded.rows)


def test_an_enumeration_has_constants_and_a_field_its_unit(arm: o80.Frontend) -> None:
    text = row_type(recorded({"hand": {"mode": Mode}}, None, 1)._layout).definition

    assert "int64 MODE_HOLD=-2" in text
    assert "# what is asked less what is there [rad]" in row_type(arm._layout).definition


def test_numbers_that_are_adjacent_are_copied_together(arm: o80.Frontend) -> None:
    plan = MessagePlan(row_type(arm._layout), arm._layout.size)

    assert len(plan._copies) <= 3  # as many as padding and masks leave


def test_names_become_valid_in_messages_and_stay_different() -> None:
    history = recorded({"Left Hand": "f8", "left-hand": "f8", "3rd": "f8"}, None, 2)
    encoded = Encoded(history)
    message = encoded.decoded(0)

    assert {"left_hand", "left_hand_2", "x_3rd"} <= set(vars(message.observed))
