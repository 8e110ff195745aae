"""Finds sensor values with a ROS 2 message type: poses, points, wrenches, images.

Names, shapes and units of the fields decide:
- `position`, or a name with this ending, three numbers [m], is a point; with a `quaternion` of
the same prefix, a pose: x, y, z, w, or w, x, y, z if its help begins with `w`;
- `force` and `torque`, or names with these endings, three numbers each, are a wrench;
- bytes whose name contains `image`, of a robot with options `height` and `width`, are images of
  one or three bytes a pixel, each in a row of the array.
"""

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

PAIRS = (("position", "quaternion", 4), ("force", "torque", 3))


@dataclass(frozen=True)
class Sensor:
    """Sensor value with a ROS message."""

    kind: str  #: point, pose, wrench or image
    name: str  #: path below the robot's topics
    structs: tuple[str, ...]  #: names of the enclosing structs of the fields
    fields: tuple[str, ...]
    valid: str = ""  #: name of a bool beside the fields, False in rows without a value
    place: int | None = None  #: index among the images of the field
    size: tuple[int, ...] = ()  #: shape of an image
    begins_with_w: bool = False  #: order of a quaternion

    def values(self, row: NDArray[Any]) -> list[NDArray[Any]] | None:
        """Returns the numbers of each field in a row; None if a value is missing."""
        within: Any = row["extended"]
        for name in self.structs:
            within = within[name]
        found = [within[name] for name in self.fields]
        if self.begins_with_w:
            found[1] = found[1][[1, 2, 3, 0]]
        valid: Any = within[self.valid] if self.valid else True
        if self.kind == "image":
            valid = valid if self.place is None or np.ndim(valid) == 0 else valid[self.place]
            found = [(found[0] if self.place is None else found[0][self.place]).reshape(self.size)]
        return found if valid and all(np.isfinite(each).all() for each in found) else None


def sensors_of(schema: Mapping[str, Any], options: Mapping[str, str]) -> list[Sensor]:
    """Lists the sensors of a robot. options: as in `Provenance.options`."""
    size = [int(text) for name in ("height", "width") if (text := options.get(name, ""))]
    return [*_sensors(schema["extended"], (), size)] if "extended" in schema else []


def _sensors(
    described: Mapping[str, Any], structs: tuple[str, ...], size: list[int]
) -> Iterator[Sensor]:
    fields = {each["name"]: each for each in described["fields"]}
    single = next((n for n in ("visible", "valid") if fields.get(n, {}).get("shape") == []), "")
    for name, field in fields.items():
        if field["kind"] == "struct" and not field["shape"]:
            yield from _sensors(field["type"], (*structs, name), size)
        for ending, partner, count in PAIRS:
            if not name.endswith(ending) or field["shape"] != [3]:
                continue
            begin, is_place = name.removesuffix(ending), ending == "position"
            both = fields.get(begin + partner, {}).get("shape") == [count]
            if field["unit"] != "m" if is_place else not both:
                continue
            kind = ("pose" if both else "point") if is_place else "wrench"
            path = "/".join(part for part in (*structs, begin.rstrip("_"), kind) if part)
            chosen = (name, begin + partner) if both else (name,)
            turned = both and fields[begin + partner]["help"].startswith("w")
            yield Sensor(kind, path, structs, chosen, single, begins_with_w=turned)
        if field["kind"] == "uint8" and "image" in name and len(size) == 2 and field["shape"]:
            *several, pixels = field["shape"]
            one = {math.prod(size): (*size,), 3 * math.prod(size): (*size, 3)}.get(pixels)
            for i in range(several[0] if several else 1) if one else ():
                path = "/".join((*structs, name + f"_{i}" * len(several), "compressed"))
                valid = "valid" if "valid" in fields else ""
                place = i if several else None
                yield Sensor("image", path, structs, (name,), valid, place, one or ())


def png(image: NDArray[np.uint8]) -> bytes:
    """Encodes an image (height, width) or (height, width, 3) as PNG."""
    height, width = image.shape[:2]
    lines = np.zeros((height, 1 + image[0].size), np.uint8)  # filter byte 0: none
    lines[:, 1:] = image.reshape(height, -1)
    colour = 2 if image.ndim == 3 else 0
    head = struct.pack(">IIBBBBB", width, height, 8, colour, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(lines.tobytes(), 1)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )
