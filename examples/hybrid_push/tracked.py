"""The learned push with a tracker in the world's place.

`Tracker` stands for cameras over a table. Its puck is on no table either: a world of its own
mirrors the arm. What it publishes is late and noisy, as that of cameras.

o80 run so101_twin --segment arm
o80 run examples/hybrid_push/tracked.py:Tracker --segment tracker --frequency 100
python -m o80.learning evaluate build/training --task examples/hybrid_push/tracked.py:Tracked \
    --copies 1 --option pacing=real_time --option attach=arm
"""

import sys
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import o80
from o80.drivers import Reading
from o80.hybrid import Index, attach

sys.path.insert(0, str(Path(__file__).parent))
from push import Push

NOISE = {"tip": 0.001, "puck_place": 0.001, "puck_velocity": 0.005}  # [m], [m], [m/s]
LATE = 1  # rows of the arm, beside up to a row of the tracker
JAW = (-0.1745, 1.7453)  # closed, open [rad]


def noisy(row: Any, random: np.random.Generator) -> dict[str, Any]:
    """Places of a row, or of several (n,), with the noise of a tracker."""
    return {name: random.normal(row[name], noise) for name, noise in NOISE.items()}


class Body(IntEnum):
    """Things that can be put somewhere."""

    puck = 0


class Tracker:
    """Where the puck that the arm of a segment pushes would be seen; a row each 10 ms."""

    extended: ClassVar[Any] = dict.fromkeys(NOISE, (float, 3))
    requests: ClassVar[Any] = {"place": {"body": Body, "position": (float, 3)}}

    @dataclass
    class Config:
        arm: str = "arm"

    def __init__(self, config: Config) -> None:
        self.config, self.random = config, np.random.default_rng(1)

    def start(self) -> None:
        self.arm = o80.Frontend(self.config.arm, read_only=True)
        options = {
            "model": self.arm.schema["model"]["file"],
            "things": Path(__file__).with_name("puck.xml"),
        }
        self.world = o80.robots.load("mujoco").inline(frequency=1 / self.arm.period, **options)
        self.row = self.arm.latest().iteration

    def read(self, reading: Reading) -> None:
        if not self.arm.alive:
            reading.fault(f"the arm '{self.arm.segment}' has ended: start it, then the tracker")
        for row in self.arm.history(since=self.row + 1).rows:
            self.row = row["iteration"]
            seen, speeds = row["observed"], row["extended"]["measured"]["velocity"]
            angles = *seen["joints"], np.interp(seen["gripper"], (0, 1), JAW)
            for joint, state in enumerate(zip(angles, (*speeds[:5], 0.0), strict=True)):
                self.world.add_command(joint, state)
            self.world.burst(1)
        late = self.world.history(LATE + 1).rows["extended"][0]
        reading.extended = noisy(late, self.random)

    def on_place(self, fields: o80.Record) -> o80.StartAfresh:
        """Puts the puck there: what a person does between two episodes."""
        self.world.request("place", body="puck", position=fields.position, velocity=(0, 0, 0))
        self.world.burst(LATE + 1)
        return o80.StartAfresh()

    def stop(self) -> None:
        self.world.close()
        self.arm.close()


class Tracked(Push):
    """The same task, its puck seen by the tracker."""

    rig = replace(Push.rig, world=attach("tracker"), things=None)


class Noisy(Push):
    """The same task in a simulated world, seen as the tracker sees: 13 ms late, with its noise."""

    def measured(self, copies: Index) -> Any:
        """The first of the three rows of a step."""
        seen = noisy(self.world.rows[copies, 0, 0]["extended"], self.random)
        return np.concatenate([seen[name] for name in self.world_numbers], axis=-1)

    def prepare(self) -> None:
        super().prepare()
        self.random = np.random.default_rng(1)
