"""The learned push with a tracker instead of the simulated world.

`Tracker` replaces cameras over a table, and its puck is simulated, too: a separate world
mirrors the arm. Its rows are late and noisy like a camera's.

o80 run so101_twin --segment arm
o80 run examples/hybrid_push/tracked.py:Tracker --segment tracker --frequency 100
python -m o80.learning evaluate build/training --task examples/hybrid_push/tracked.py:Tracked \
    --copies 1 --option pacing=real_time --option attach=arm
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np

import o80
from o80.drivers import Reading
from o80.hybrid import Index, attach
from o80_arms.push import Push

NOISE = {"tip": 0.001, "puck_place": 0.001, "puck_velocity": 0.005}  # [m], [m], [m/s]
LATE = 1  # delay in rows of the arm; up to a row of the tracker is added
JAW = (-0.1745, 1.7453)  # closed, open [rad]


def noisy(row: Any, random: np.random.Generator) -> dict[str, Any]:
    """Adds a tracker's noise to the places of a row, or of rows (n,)."""
    return {name: random.normal(row[name], noise) for name, noise in NOISE.items()}


class Body(IntEnum):
    """Bodies that can be placed."""

    puck = 0


class Tracker:
    """Publishes simulated sightings of the puck that a segment's arm pushes, a row each 10 ms."""

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
            "things": Push.rig.things,
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
        """Places the puck, as a person does between two episodes."""
        self.world.request("place", body="puck", position=fields.position, velocity=(0, 0, 0))
        self.world.burst(LATE + 1)
        return o80.StartAfresh()

    def stop(self) -> None:
        self.world.close()
        self.arm.close()


class Tracked(Push):
    """The push task with the puck's places from the tracker."""

    rig = replace(Push.rig, world=attach("tracker"), things=None)


class Noisy(Push):
    """The push task in a simulated world, with the tracker's noise and delay of 13 ms."""

    def measured(self, copies: Index) -> Any:
        """Reads the first of the three rows of a step, with noise."""
        seen = noisy(self.world.rows[copies, 0, 0]["extended"], self.random)
        return np.concatenate([seen[name] for name in self.world_numbers], axis=-1)

    def prepare(self) -> None:
        super().prepare()
        self.random = np.random.default_rng(1)
