"""Reads the model file of the scene without a simulator.

Table, net, ball, racket and arm are described in `table_tennis.xml` only: the twins simulate
that file, pictures are drawn from it, and the other modules of this package read it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from xml.etree import ElementTree

MODEL = Path(__file__).with_name("table_tennis.xml")

Vector = tuple[float, float, float]


@cache
def _root() -> ElementTree.Element:
    return ElementTree.parse(MODEL).getroot()


def element(path: str) -> ElementTree.Element:
    """Finds the first element at an ElementTree path, such as ".//geom[@name='table']".

    Raises LookupError if there is none.
    """
    found = _root().find(path)
    if found is None:
        raise LookupError(f"{MODEL.name} has no element {path}")
    return found


def geom(name: str) -> ElementTree.Element:
    """Finds the geom of this name."""
    return element(f".//geom[@name='{name}']")


def body(name: str) -> ElementTree.Element:
    """Finds the body of this name."""
    return element(f".//body[@name='{name}']")


def joints_of(name: str) -> list[ElementTree.Element]:
    """Lists the joints of a body and of its descendants, outwards."""
    return list(body(name).iter("joint"))


def numbers(part: ElementTree.Element, attribute: str) -> tuple[float, ...]:
    """Parses the numbers of an attribute."""
    return tuple(float(number) for number in part.attrib[attribute].split())


def vector(part: ElementTree.Element, attribute: str) -> Vector:
    """Parses the three numbers of an attribute."""
    x, y, z = numbers(part, attribute)
    return x, y, z


def full_size(part: ElementTree.Element) -> Vector:
    """Computes the lengths of a box or ellipsoid along its axes; the file has half lengths [m]."""
    x, y, z = vector(part, "size")
    return 2 * x, 2 * y, 2 * z
