"""A robot and the world that mirrors it."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any, Literal

from o80.base.argument_checks import whole
from o80.base.errors import InvalidArgument
from o80.hybrid.mirror import Mirror, Pair, pairs_of
from o80.robots.robot import Robot, load

AnyRobot = str | os.PathLike[str] | type | Robot
"""A robot: its name, path or driver class, or a loaded one."""

_NUMBERS = count(1)


@dataclass(frozen=True)
class attach:  # noqa: N801, it reads as a function where a world is given
    """A world that runs in another process: `make(Push, world=attach("tracker"), ...)`.

    segment: a bursting world mirrors the robot, like a world that the rig has started. A world with
        a clock, such as a tracker, is only read: its rows must have the names that the task reads,
        and keep their own times.
    """

    segment: str


@dataclass(frozen=True, kw_only=True)
class Rig:
    """A robot and the world that mirrors it, stepped together.

    The iterations of the robot are the only clock: the world makes one iteration for each of them,
    with its joints at the robot's positions. Nothing in the world pushes the robot back.
    """

    robot: AnyRobot
    """Any robot of o80."""
    world: AnyRobot | attach
    """A robot that simulates, or `attach(segment)` for one that runs already. For a robot that
    shows a model file, such as "so101_twin", o80-mujoco simulates this model; "mujoco" takes the
    model from `world_options`."""
    mirror: Mirror = field(default_factory=Mirror)
    robot_options: Mapping[str, Any] = field(default_factory=dict)
    world_options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the drivers, and `history` and `lane_blocks` of `Robot.start`. A relative path of
    `model` refers to the folder of the task's file."""
    things: str | os.PathLike[str] | None = None
    """An MJCF file whose bodies are added to the world's model; a relative path as above."""
    every: int
    """Iterations in a step."""
    delay: int = 1
    """Iterations from the newest row to the first one in which an action acts, minus 1. Below
    `every`, with chunks below `every` x `action_steps`. In real time this is the time to decide."""
    worlds: int | None = None
    """Worlds for each robot, all of which mirror its motion; results of tasks then have this
    dimension, (copies, worlds, ...). None: one world, without this dimension."""
    end: Literal["first", "all"] = "first"
    """The episode of a robot ends with the episode of its first world, or after those of all.
    A world whose episode has ended continues to mirror."""
    frequency: float | None = None
    """Iterations a second [1/s] (None: the robot's own)."""

    def __post_init__(self) -> None:
        whole(self.every, "every (iterations)", 1)
        whole(self.delay, "delay (iterations)", 0)
        if self.worlds is not None:
            whole(self.worlds, "worlds", 1)
        if self.end not in ("first", "all"):
            raise InvalidArgument(f"end must be 'first' or 'all', got {self.end!r}")
        if not isinstance(self.mirror, Mirror):
            raise InvalidArgument(f"mirror must be a Mirror, got {self.mirror!r}")

    def beside(self, folder: Path) -> "Rig":
        """Returns this rig, with robots that are files (libraries, Python) in this folder."""
        robot, world = (_beside(each, folder) for each in (self.robot, self.world))
        return replace(self, robot=robot, world=world)


def _beside(robot: Any, folder: Path) -> Any:
    if not isinstance(robot, str | os.PathLike):
        return robot
    file = folder / os.fspath(robot).partition(":")[0]
    return str(folder / robot) if file.suffix in (".so", ".py") and file.is_file() else robot


def robot_of(robot: AnyRobot) -> Robot:
    """Loads a robot, unless it is loaded. Raises DriverError if that fails."""
    return robot if isinstance(robot, Robot) else load(robot)


def unused_name(robot: Robot) -> str:
    """Returns a segment name that no other rig uses."""
    return f"{robot.name}-{os.getpid()}-{next(_NUMBERS)}"


class World:
    """The simulation of a rig before its start: its options, and the pairs that it mirrors."""

    def __init__(
        self,
        rig: Rig,
        folder: Path,
        robot: Mapping[str, Any],
        name: str,
        schema: Mapping[str, Any] | None = None,
    ) -> None:
        """folder: base of relative paths. robot, name: schema and name of the robot.

        schema: schema of a world that runs already. Raises InvalidArgument if the robot cannot be
        mirrored, DriverError if the world cannot be loaded.
        """
        if schema is not None:
            given, own = schema, False
        else:
            self.robot, self.options = _simulation(rig, folder)
            given = self.robot.describe(**_of_driver(self.options))
            own = self.robot._library.name == "mujoco"
        joints = {actuator["name"]: _unit(given, actuator) for actuator in given["actuators"]}
        self.pairs = pairs_of(rig.mirror, {**robot, "robot": name}, joints, _name(rig.world))
        self.joints = [pair.joint for pair in self.pairs]
        self._has_velocity(rig, given)
        if own and "joints" not in self.options:
            self.options["joints"] = ", ".join(map(_entry, self.pairs))
        elif spread := [pair.joint for pair in self.pairs if pair.over]:
            raise InvalidArgument(
                f"mirror: '{spread[0]}' has the unit 1, and only worlds of o80-mujoco spread it "
                "over the range of a joint"
            )

    def _has_velocity(self, rig: Rig, schema: Mapping[str, Any]) -> None:
        moves = {actuator["name"]: actuator["group"] for actuator in schema["actuators"]}
        fields = {
            part["name"]
            for joint in self.joints
            for part in schema["groups"][moves[joint]]["type"]["fields"]
        }
        self.states_have_names = fields != {""}
        """Whether a state of a joint is a position and a velocity, and not one number."""
        if "velocity" in fields and rig.mirror.velocity is None:
            raise InvalidArgument(
                f"mirror: the joints of world '{_name(rig.world)}' need a velocity: give the path "
                "of one in the robot's rows as Mirror(velocity=...), or difference(rows=3). "
                "With velocity 0 a moving arm hits as if it stood still"
            )


def _simulation(rig: Rig, folder: Path) -> tuple[Robot, dict[str, Any]]:
    options = dict(rig.world_options)
    assert not isinstance(rig.world, attach)
    robot = robot_of(rig.world)
    if robot._library.name != "mujoco" or "like" in robot._given:
        shown = robot.describe(**_of_driver(options)).get("model", {}).get("file", "")
        if shown:
            options = {"model": shown}
            robot = load("mujoco")
    if isinstance(options.get("model"), str | os.PathLike):
        options["model"] = str(folder / options["model"])
    if rig.things is not None:
        if robot._library.name != "mujoco":
            raise InvalidArgument(
                f"things need a model of o80-mujoco, which world '{robot.name}' does not have"
            )
        options["things"] = str(folder / rig.things)
    return robot, options


def _of_driver(options: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the options without those of the backend."""
    aside = ("segment", "history", "lanes", "lane_blocks")
    return {name: value for name, value in options.items() if name not in aside}


def _entry(pair: Pair) -> str:
    """Formats a pair for the option `joints` of o80-mujoco."""
    if pair.over is None:
        return pair.joint
    return f"{pair.joint}={pair.joint} {pair.over[0]:g} {pair.over[1]:g}"


def _unit(schema: Mapping[str, Any], actuator: Mapping[str, Any]) -> str:
    """Returns the unit of a joint's position."""
    fields = schema["groups"][actuator["group"]]["type"]["fields"]
    return str(next((each["unit"] for each in fields if each["name"] in ("", "position")), ""))


def _name(robot: AnyRobot | attach) -> str:
    return robot.__name__ if isinstance(robot, type) else getattr(robot, "name", None) or str(robot)
