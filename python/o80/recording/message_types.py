"""Message types of a robot's rows, in the language of ROS 2 interface files (ros2msg).

Public readers of MCAP files (Foxglove, PlotJuggler, rosbags) decode rows by these definitions. A
type has a hash of its definition in its name, because readers allow one definition per name in a
file.
"""

import hashlib
import math
import re
from dataclasses import dataclass, field, replace
from typing import Any

from o80.rows.layout import HEAD, MASKS, Layout, dtype_of_field, is_plain

PACKAGE = "o80"
SEPARATOR = "=" * 80
TIME = f"""\
{SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
"""Definition of builtin_interfaces/Time, which other types contain."""
HEADER = f"""\
{SEPARATOR}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{TIME}"""
"""Definition of std_msgs/Header and of the type that it contains."""


@dataclass(frozen=True)
class Member:
    """One member of a message type."""

    name: str
    kind: str  #: type in ROS 2 (float64, bool, ...), or the name of a MessageType
    size: int  #: bytes of a number, or of an element in the row
    offset: int  #: offset in the row, or in the enclosing struct [bytes]
    count: int | None = None  #: elements of an array; None: no array
    type: "MessageType | None" = None
    #: a mask of the row: one bit per element there, one bool in the message; `type` may name them
    bits: bool = False


@dataclass(frozen=True)
class MessageType:
    """A definition, with the offsets of its members in a row."""

    name: str
    text: str
    members: tuple[Member, ...] = field(repr=False)

    @property
    def definition(self) -> str:
        """Text of this type and of all types in it, in the form of MCAP schemas."""
        parts = [self.text]
        parts += [f"{SEPARATOR}\nMSG: {PACKAGE}/{each.name}\n{each.text}" for each in self.inner()]
        return "\n".join(parts)

    def inner(self) -> list["MessageType"]:
        """Types of all members, also nested ones, each once."""
        found: dict[str, MessageType] = {}
        for member in self.members:
            if member.type is not None:
                found.setdefault(member.type.name, member.type)
                found.update({each.name: each for each in member.type.inner()})
        return list(found.values())


def row_type(layout: Layout) -> MessageType:
    """The message type of a robot's rows."""
    row = layout.schema["row"]
    numbers = {"i8": ("int64", 8), "u4": ("uint32", 4)}
    members = [Member(name, *numbers[kind], row[name]) for name, kind in HEAD]
    if layout.actuators:
        states = _states_members(layout)
        members += [
            replace(states, name=part, offset=row[part] + states.offset)
            for part in ("desired", "observed")
        ]
        mask_type = None
        if _has_names(layout):
            names = [_field_name(each["name"]) for each in layout.schema["actuators"]]
            mask_type = _type("Mask", [Member(name, "bool", 1, 0) for name in names])
        members += [
            Member(
                mask,
                mask_type.name if mask_type else "bool",
                1,
                row[mask],
                layout.actuators,
                mask_type,
                True,
            )
            for mask in MASKS
        ]
        members.append(Member("off_plan", "float32", 4, row["off_plan"], layout.actuators))
    if layout.extras.itemsize:
        extended = _struct(layout.schema["extended"], "Extended")
        members.append(Member("extended", extended.name, 0, row["extended"], None, extended))
    return _type(_identifier(layout.schema["robot"], "Robot"), members)


def _states_members(layout: Layout) -> Member:
    """Describes all actuator states as one member: an array, or a struct of actuators or groups."""
    groups = layout.schema["groups"]
    if _has_names(layout):
        described = [(each, groups[each["group"]]["type"]) for each in layout.schema["actuators"]]
        members = [_state_member(kind, each["name"], each["offset"]) for each, kind in described]
        notes = {
            each["name"]: _note(kind["fields"][0]) for each, kind in described if is_plain(kind)
        }
    else:
        members, notes = [], {}
        for group in groups:
            name, count = group["name"] or "state", group["count"] if group["array"] else None
            members.append(_state_member(group["type"], name, group["offset"], count))
        if len(groups) == 1 and not groups[0]["name"]:
            return members[0]
    states = _type("States", members, notes=notes)
    return Member("", states.name, 0, 0, None, states)


def _has_names(layout: Layout) -> bool:
    """True if the actuators have own names; the default names are `GROUP_0`, `GROUP_1`, ..."""
    for group in layout.schema["groups"]:
        first = group["first_actuator"]
        for i in range(group["count"] if group["array"] else 0):
            if layout.schema["actuators"][first + i]["name"] != f"{group['name']}_{i}".lstrip("_"):
                return True
    return not any(group["array"] for group in layout.schema["groups"])


def _state_member(
    described: dict[str, Any], name: str, offset: int, count: int | None = None
) -> Member:
    """Describes one state, or an array of `count` states."""
    if is_plain(described):
        plain = _field_member(described["fields"][0], name)
        inner = plain.count or 1
        total = inner * (count or 1) if count is not None or plain.count is not None else None
        return Member(plain.name, plain.kind, plain.size, offset, total, plain.type)
    struct = _struct(described, name)
    return Member(_field_name(name), struct.name, described["size"], offset, count, struct)


def _struct(described: dict[str, Any], fallback: str) -> MessageType:
    members = [_field_member(each, each["name"]) for each in described["fields"]]
    constants = [line for each in described["fields"] for line in _constants(each)]
    notes = {
        member.name: _note(each) for member, each in zip(members, described["fields"], strict=True)
    }
    return _type(_identifier(described["name"], fallback), members, constants, notes)


def _field_member(described: dict[str, Any], name: str) -> Member:
    array = math.prod(described["shape"]) if described["shape"] else None
    if described["kind"] == "struct":
        inner = _struct(described["type"], name)
        return Member(
            _field_name(name), inner.name, described["size"], described["offset"], array, inner
        )
    kind = dtype_of_field(described).name
    return Member(_field_name(name), kind, described["size"], described["offset"], array)


def _constants(described: dict[str, Any]) -> list[str]:
    """Returns an enumeration's labels as constants of its number type."""
    if described["kind"] != "enum":
        return []
    kind = dtype_of_field(described).name
    prefix = _field_name(described["name"] or "state").upper()
    return [
        f"{kind} {prefix}_{_field_name(label).upper()}={number}"
        for label, number in described["labels"].items()
    ]


def _note(described: dict[str, Any]) -> str:
    unit = f"[{described['unit']}]" if described["unit"] else ""
    return " ".join(part for part in (described["help"], unit) if part).replace("\n", " ")


def _type(
    base: str,
    members: list[Member],
    constants: list[str] | None = None,
    notes: dict[str, str] | None = None,
) -> MessageType:
    lines = list(constants or [])
    members = _with_unique_names(members)
    for member in members:
        kind = member.kind if member.type is None else f"{PACKAGE}/{member.type.name}"
        is_array = member.count is not None and not (member.bits and member.type)
        array = f"[{member.count}]" if is_array else ""
        note = (notes or {}).get(member.name, "")
        lines.append(f"{kind}{array} {member.name}" + (f"  # {note}" if note else ""))
    text = "\n".join(lines) + "\n"
    digest = hashlib.sha256(text.encode()).hexdigest()[:8]
    return MessageType(f"{base}X{digest}", text, tuple(members))


def _with_unique_names(members: list[Member]) -> list[Member]:
    taken: set[str] = set()
    result = []
    for member in members:
        name, number = member.name, 1
        while name in taken:
            number += 1
            name = f"{member.name}_{number}"
        taken.add(name)
        result.append(replace(member, name=name))
    return result


def _field_name(name: str) -> str:
    """Makes a valid member name: lower case, digits, single underscores, a letter first."""
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    return plain if plain and plain[0].isalpha() else f"x_{plain}".rstrip("_")


def _identifier(name: str, fallback: str) -> str:
    """Makes a valid type name: letters and digits, upper case first; or uses the fallback."""
    words = re.findall(r"[A-Za-z0-9]+", name) or re.findall(r"[A-Za-z0-9]+", fallback)
    joined = "".join(word[0].upper() + word[1:] for word in words) or "Type"
    return joined if joined[0].isalpha() else f"T{joined}"
