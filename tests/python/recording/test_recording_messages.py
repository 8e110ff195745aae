"""Rows as messages: their definitions. test_row_layouts.py reads them with public decoders."""

from mixed_robots import Mode, recorded

import o80
from o80.recording.message_types import row_type


def test_an_enumeration_has_constants_and_a_field_its_unit(arm: o80.Frontend) -> None:
    text = row_type(recorded({"hand": {"mode": Mode}}, None, 1)._layout).definition

    assert "int64 MODE_HOLD=-2" in text
    assert "# what is asked less what is there [rad]" in row_type(arm._layout).definition


def test_names_become_valid_in_messages_and_stay_different() -> None:
    history = recorded({"Left Hand": "f8", "left-hand": "f8", "3rd": "f8"}, None, 2)
    text = row_type(history._layout).definition
    names = {line.split()[1] for line in text.splitlines() if line.startswith("float64")}

    assert {"left_hand", "left_hand_2", "x_3rd"} <= names
