"""The models that draw segments, and the rule by which they share one world."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from o80.rows.columns import columns_of

JOINTS = ("joint", "freejoint")
MAX_PLACES = 64
_PLACE = """<body name=%s><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<geom size="0.024" rgba="0.10 0.65 0.40 0.55"/></body>"""


@dataclass(frozen=True)
class Drawn:
    """The model of a segment."""

    mjcf: str
    described: dict[str, Any]  #: the values that move it, as in a schema
    trusted: bool  #: the files that it names may be read
    standing: "Standing"


def drawn(schema: dict[str, Any], mjcf: str, *, trusted: bool) -> Drawn | None:
    """Returns the model of a robot, or None. A sensor without a model is drawn as balls at its
    measured positions: each three numbers `position` in metres among its sensor values.
    """
    if "model" in schema:
        return Drawn(mjcf, schema["model"], trusted, standing(mjcf))
    start = schema["row"]["extended"] if "extended" in schema else 0
    places = {
        column.name.removesuffix(".position[0]"): column.offset - start
        for column in columns_of(schema)
        if column.name.startswith("extended.")
        and column.name.endswith(".position[0]")
        and (column.unit, column.dtype.str) == ("m", "<f8")
    }
    if not 0 < len(places) <= MAX_PLACES:
        return None
    bodies = "".join(_PLACE % quoteattr(name) for name in places)
    values = [
        {"what": "position", "name": name, "from": "extended", "offset": offset}
        for name, offset in places.items()
    ]
    text = f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"
    return Drawn(text, {"file": "", "values": values}, True, Standing(floats=True))


@dataclass(frozen=True)
class Standing:
    """Fixed places of a model."""

    #: name and position [mm] of the bodies and shapes that the world carries
    places: frozenset[tuple[str, int, int, int]] = frozenset()
    floats: bool = False  #: no body of it is fixed: a tracked ball, subjects of motion capture

    def shares(self, other: "Standing") -> bool:
        """True if both share a world: one floats, or both have a named thing at the same place."""
        return self.floats or other.floats or not self.places.isdisjoint(other.places)


@lru_cache(maxsize=64)
def standing(mjcf: str) -> Standing:
    """Finds the fixed places of a model (MJCF); none in a text that cannot be parsed."""
    if "<!DOCTYPE" in mjcf or "<!ENTITY" in mjcf:  # it may come from a stranger
        return Standing()
    try:
        worldbodies = ElementTree.fromstring(mjcf).findall("worldbody")
    except (ElementTree.ParseError, ValueError):
        return Standing()
    carried = [each for body in worldbodies for each in body if each.tag in ("body", "geom")]
    fixed = [each for each in carried if not any(inner.tag in JOINTS for inner in each)]
    named = [each for each in carried if each.get("type") != "plane" and each.get("name")]
    places = {place for each in named if (place := _place(each)) is not None}
    return Standing(frozenset(places), floats=bool(carried) and not fixed)


def _place(element: ElementTree.Element) -> tuple[str, int, int, int] | None:
    try:
        x, y, z = (round(1e3 * float(word)) for word in element.get("pos", "0 0 0").split())
    except (ValueError, OverflowError):
        return None
    return element.get("name", ""), x, y, z
