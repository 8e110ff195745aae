"""Source of a driver in Python, a cart, to be written to a file."""

from pathlib import Path

CART = """
import random
import time
import numpy as np
import o80


class Cart:
    simulated = True
    actuators = ("x",)
    limits = {"x": o80.Limits(minimum=-1.0, maximum=1.0)}
    requests = {
        "reset": {"seed": np.uint64},
        "snapshot": {"slot": np.uint32},
        "restore": {"slot": np.uint32},
    }
    made = 0

    def __init__(self):
        type(self).made += 1
        self.x, self.speed, self.kept, self.past = 0.0, 0.0, {}, 0.0

    def write(self, desired):
        self.speed += 0.1 * (desired[0] - self.x) - 0.05 * self.speed
        self.x = min(max(self.x + self.speed, -1.0), 1.0)
        self.past += abs(desired[0])

    def read(self, reading):
        reading.observed[0] = self.x

    def on_reset(self, fields):
        self.x, self.speed = random.Random(fields.seed).uniform(-1, 1), 0.0
        return o80.StartAfresh()

    def on_snapshot(self, fields):
        self.kept[int(fields.slot)] = (self.x, self.speed)

    def on_restore(self, fields):
        self.x, self.speed = self.kept[int(fields.slot)]
        return o80.StartAfresh()
"""


def written(folder: Path, name: str, *changes: tuple[str, str]) -> str:
    """Writes the cart to a file, with replaced texts; returns its place for `load`."""
    text = CART
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / f"{name}.py").write_text(text)
    return f"{folder / name}.py:Cart"
