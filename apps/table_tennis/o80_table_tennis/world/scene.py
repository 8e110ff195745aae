"""The model file of the scene, and how its figures are read without a simulator.

Table, net, ball, racket and arm are described in `table_tennis.xml` and nowhere else: the twins
simulate that file, pictures are drawn from it, and the other modules of this package read from it.
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
    """The first element of the model at an ElementTree path, as ".//geom[@name='table']".

    Raises LookupError.
    """
    found = _root().find(path)
    if found is None:
        raise LookupError(f"{MODEL.name} has no element {path}")
    return found


def geom(name: str) -> ElementTree.Element:
    """The geom of this name."""
    return element(f".//geom[@name='{name}']")


def body(name: str) -> ElementTree.Element:
    """The body of this name."""
    return element(f".//body[@name='{name}']")


def joints_of(name: str) -> list[ElementTree.Element]:
    """The joints of a body and of all bodies that it carries, outwards."""
    return list(body(name).iter("joint"))


def numbers(part: ElementTree.Element, attribute: str) -> tuple[float, ...]:
    """The numbers of an attribute."""
    return tuple(float(number) for number in part.attrib[attribute].split())


def vector(part: ElementTree.Element, attribute: str) -> Vector:
    """The three numbers of an attribute."""
    x, y, z = numbers(part, attribute)
    return x, y, z


def full_size(part: ElementTree.Element) -> Vector:
    """Lengths of a box or ellipsoid along its axes; the file has the halves [m]."""
    x, y, z = vector(part, "size")
    return 2 * x, 2 * y, 2 * z
