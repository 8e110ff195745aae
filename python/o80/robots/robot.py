"""Finds, describes and starts robots."""

import builtins
import inspect
import numbers
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.errors import DriverError, InvalidArgument, exception_text, sentence
from o80.base.installation import announced, prefix
from o80.base.loop_options import did_you_mean, loop_options, loop_texts, names_of, text_of
from o80.base.refusals import explained
from o80.base.words import StaleWord
from o80.frontend.frontend import Frontend
from o80.robots.face import compared, described, is_text_of_face, text_of_face
from o80.robots.process import Process, start_process

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from o80.groups.inline_group import InlineGroup

GROUP = "o80.robots"


@dataclass(frozen=True)
class RobotFile:
    """A robot that can be loaded by its name."""

    name: str
    path: Path


@dataclass(frozen=True, kw_only=True)
class Option:
    """One option of a robot, a field of its described Config."""

    name: str
    kind: str  #: number, integer, boolean, text, seed, face, "one of: a, b", or "3 x number"
    default: str  #: as text
    help: str
    unit: str


def list() -> builtins.list[RobotFile]:
    """Lists all robots with a name: in O80_ROBOT_PATH, bundled with o80, and in Python packages.

    A robot whose package fails, or needs a missing one, is left out: `load` raises the reason.
    """
    robots = {name: Path(path) for name, path in _core.find_robots()}
    for name in announced(GROUP):
        if name not in robots:
            with suppress(DriverError):
                robots[name] = path_of(name)
    return [RobotFile(name, path) for name, path in robots.items()]


def path_of(name_or_path: str | os.PathLike[str]) -> Path:
    """Returns the library of a robot, given its name or a path.

    Raises DriverError for an unknown name, with the known robots in its text.
    """
    robot = found(name_or_path)
    if isinstance(robot, tuple):
        return path_of(robot[0])
    if isinstance(robot, type):
        return Path(inspect.getsourcefile(robot) or robot.__module__)
    return robot


def found(name_or_path: str | os.PathLike[str]) -> "Path | type[Any] | tuple[str, Any]":
    """Finds a robot: its library; a driver class; or, for a name that a package announces for a
    robot with options, the robot and a function that returns the options.

    Raises DriverError for an unknown name, with the known robots in its text.
    """
    text = os.fspath(name_or_path)
    if os.sep in text or (text.endswith(".so") and Path(text).exists()):
        return Path(text).absolute()
    bundled, packaged = dict(_core.find_robots()), announced(GROUP)
    if text in bundled:
        return Path(bundled[text])
    if text in packaged:
        return _value_of(packaged[text])
    raise DriverError(_core.no_such_robot(text, [*bundled, *packaged]))


def load(name_or_path: str | os.PathLike[str] | type[Any]) -> "Robot":
    """Loads a robot by its name, by the path of its library, or by a driver class in Python.

    A class is given as such, or as "module:Class" or "file.py:Class", which imports the module.
    Raises DriverError with the known robots in its text.
    """
    if isinstance(name_or_path, type):
        return PythonRobot(name_or_path)
    place = os.fspath(name_or_path)
    if is_place(place):
        return PythonRobot(place)
    of_name = found(place)
    if isinstance(of_name, type):
        return PythonRobot(of_name)
    if isinstance(of_name, tuple):
        robot = load(of_name[0])
        robot._announced, robot._given = place, of_name[1]()
        return robot
    return Robot(_core.load_robot(str(of_name)))


def face(of: Any) -> dict[str, Any]:
    """Returns the face of a robot: the properties that programs rely on, as plain data.

    Groups, actuators with their limits, sensor values and requests, without those of simulations
    (reset, snapshot, restore). A script that runs on one robot runs on each with an equal face.

    of: a Robot, a frontend, a recorded segment, or the name of a running segment, of a robot, of a
        recording (FILE.mcap, FILE.mcap:SEGMENT) or of a JSON file.

    Raises InvalidArgument, DriverError, RecordingError if `of` is unknown or unusable.
    """
    return compared(described(of, load))


def face_text(of: Any) -> str:
    """Returns the text of an option that takes a face; keeps such a text, and an empty one."""
    return of if of == "" or is_text_of_face(of) else text_of_face(described(of, load))


def is_place(text: str) -> bool:
    """True for "module:Class" and "file.py:Class"."""
    where, colon, name = text.rpartition(":")
    return bool(colon and where) and name.isidentifier()


def _value_of(point: "EntryPoint") -> "Path | type[Any] | tuple[str, Any]":
    """Loads an entry point: a driver class, a path, the name of a robot with a function that
    returns options for it, or a function that returns one of these.
    """
    package = point.dist.name if point.dist is not None else point.module
    try:
        value = point.load()
        value = value if isinstance(value, type) or not callable(value) else value()
    except Exception as error:
        raise DriverError(
            f"robot '{point.name}' cannot be loaded: the package {package}, which announces it, "
            f"failed with {sentence(exception_text(error))} Repair the package or uninstall it"
        ) from error
    if isinstance(value, (str, os.PathLike)):
        return Path(value)
    if isinstance(value, (type, tuple)):
        return value
    raise DriverError(
        f"entry point '{point.name}' of the group {GROUP} gives {value!r}: it must be a driver "
        f"class, the path of a robot library, or a function that gives it"
    )


class Robot:
    """A loaded robot library. It does not touch hardware before it is started."""

    def __init__(self, library: _core.RobotLibrary) -> None:
        self._library = library
        self._announced = ""  # the name for this robot with the options `_given`
        self._given: dict[str, Any] = {}

    @property
    def name(self) -> str:
        """Name of the robot (O80_ROBOT), or a package's name for this robot with options."""
        return self._announced or self._library.name

    @property
    def path(self) -> Path:
        """Path of the library."""
        return Path(self._library.path)

    @property
    def built_with(self) -> str:
        """Versions of o80 and of the libraries that the robot links."""
        return self._library.built_with

    @property
    def options(self) -> builtins.list[Option]:
        """The robot's own options, besides those of every robot."""
        names = [field.name for field in fields(Option)]
        return [
            Option(**{name: getattr(option, name) for name in names})
            for option in self._library.options
        ]

    def describe(self, **config: Any) -> dict[str, Any]:
        """Returns the description of its segment (`Frontend.schema`) without starting the robot.

        config: the robot's own options, see `options`. Raises InvalidArgument for wrong ones.
        """
        return self._library.describe(self._config(config, ())).schema()

    @property
    def _program(self) -> builtins.list[str | Path]:
        """Command that runs this robot in a process."""
        return [prefix() / "bin" / "o80-run", self._library.path]

    @property
    def _environment(self) -> dict[str, str] | None:
        """Environment variables of the robot's process; None: those of this process."""
        return None

    def start(
        self,
        segment: str | None = None,
        *,
        frequency: float | None = None,
        bursting: bool = False,
        history: int | None = None,
        lanes: int | None = None,
        lane_blocks: int | None = None,
        journal: float | None = None,
        permission: int | None = None,
        stale: StaleWord | None = None,
        silence: int | None = None,
        max_overruns: int | None = None,
        gap: float | None = None,
        accept_reading: bool = False,
        resume: bool = False,
        policy: Literal["other", "fifo", "rr", "auto"] | None = None,
        priority: int | None = None,
        cpus: Sequence[int] | None = None,
        lock_memory: bool = False,
        timeout: float | None = 30.0,
        **config: Any,
    ) -> Process:
        """Starts the robot in a process of its own, which ends when this process ends.

        segment: name of its segment (None: the name of the robot).
        frequency: iterations a second [1/s]; in bursting mode, of simulated time. None: the robot's
            own (for simulators, that of the model), or 1000.
        bursting: run only the iterations that frontends request.
        history: number of observations kept (None: as many as 16 MiB hold, at most 100000).
        lanes, lane_blocks: frontends that may command at once, and blocks of 64 bytes that each
            may have in flight.
        journal: size of the journal [MiB] (None: twice the largest batch). A batch may be half as
            large.
        permission: the read bits permit users to observe, the write bits to command.
        stale: policy for a frontend that dies, or gives no sign of life for `silence` iterations
            while it has control or commands: "hold" does nothing, "purge" drops its commands,
            "halt" halts the robot, "stop" stops it. None: "halt" with `silence`, else "hold". Signs
            of life are a pulse, a wait for a batch and `keep_alive`, but not reading.
        max_overruns: number of late iterations within a second that halts the robot.
        gap: a longer time between two iterations halts the robot [s]; 0: none does; None: 20
            periods and at least 0.1 s for robots of the world, none for simulations, or less if
            the driver describes it.
        accept_reading: start at the read position, even if the robot cannot have reached it.
        resume: start without a halt even if the previous process was halted, or was killed while
            commands acted.
        policy, priority, cpus, lock_memory: real-time scheduling; settings that the machine refuses
            give a RuntimeWarning.
        timeout: how long to wait until the robot runs [s].
        config: the robot's own options, see `options`.

        docs/options.md lists allowed values and defaults. Returns when the robot runs. Raises
        DriverError with the driver's fault, SegmentTaken, InvalidArgument, TimeoutError.
        """
        known = names_of("start")
        texts = loop_texts(locals(), known)
        switches = {option.name for option in loop_options().values() if option.kind == "boolean"}
        words = [
            f"--{name.replace('_', '-')}" + ("" if name in switches else f"={text}")
            for name, text in texts
        ]
        words += [f"--{name}={text}" for name, text in self._config(config, known)]
        name = segment or self.name
        with explained(f"start the robot of '{name}'"):
            return start_process(self._program, name, words, timeout, self._environment)

    @overload
    def inline(
        self,
        segment: str | None = None,
        *,
        frequency: float | None = None,
        history: int | None = None,
        lanes: int | None = None,
        lane_blocks: int | None = None,
        journal: float | None = None,
        permission: int | None = None,
        stale: StaleWord | None = None,
        silence: int | None = None,
        copies: None = None,
        threads: None = None,
        **config: Any,
    ) -> Frontend: ...
    @overload
    def inline(
        self,
        segment: None = None,
        *,
        copies: int,
        threads: "int | InlineGroup | None" = None,
        frequency: float | None = None,
        history: int | None = None,
        lanes: int | None = None,
        lane_blocks: int | None = None,
        journal: float | None = None,
        permission: int | None = None,
        stale: StaleWord | None = None,
        silence: int | None = None,
        **config: Any,
    ) -> "InlineGroup": ...
    def inline(
        self,
        segment: str | None = None,
        *,
        frequency: float | None = None,
        history: int | None = None,
        lanes: int | None = None,
        lane_blocks: int | None = None,
        journal: float | None = None,
        permission: int | None = None,
        stale: StaleWord | None = None,
        silence: int | None = None,
        copies: int | None = None,
        threads: "int | InlineGroup | None" = None,
        **config: Any,
    ) -> "Frontend | InlineGroup":
        """Starts the robot in this process. A burst runs in the thread that requests it.

        segment: name of its segment, to which others may attach (None: an unused name).
        frequency, history, lanes, lane_blocks, journal, permission, stale, silence: as for `start`.
        copies: start this number of copies as an InlineGroup, which steps them all. Their segments
            have no names. Copies keep 64 rows, two lanes of 256 blocks and no journal, unless these
            options say otherwise.
        threads: threads that step the copies, the calling one included (None: one for each
            processor); or another group, whose threads are used: call the two in turn.
        config: the robot's own options, see `options`.

        Closing the frontend or the group stops the robot. Raises DriverError with the driver's
        fault, SegmentTaken, InvalidArgument.
        """
        known = names_of("inline")
        texts = loop_texts(locals(), known)
        own = self._config(config, known)
        if copies is not None:
            return self._group(copies, threads, segment, texts, own)
        if threads is not None:
            raise InvalidArgument("threads is for several copies: give copies too")
        name = segment or _core.unused_segment_name(self.name)
        try:
            attachment = self._library.start_inline(name, texts, own)
        except Exception:
            if segment is None:
                _core.clean(name)  # no other process can know this name
            raise
        return Frontend._of(attachment, unnamed=segment is None)

    def _group(
        self,
        copies: int,
        threads: "int | InlineGroup | None",
        segment: str | None,
        texts: builtins.list[tuple[str, str]],
        own: builtins.list[tuple[str, str]],
    ) -> "InlineGroup":
        from o80.groups.inline_group import InlineGroup

        if segment is not None:
            raise InvalidArgument(
                "the copies of a group have no names: leave out segment, and name one of them with "
                "`group.publish(copy, name)`"
            )
        count = whole(copies, "copies", 1)
        sharing, workers = None, 0
        if isinstance(threads, InlineGroup):
            sharing = threads._group
            sharing.check_usable()
        elif threads is not None:
            workers = whole(threads, "threads", 1)
        return InlineGroup(_core.start_group(self._library, count, workers, sharing, texts, own))

    def _config(
        self, config: Mapping[str, Any], loop: Sequence[str]
    ) -> builtins.list[tuple[str, str]]:
        """Converts the robot's own options to texts. loop: other known names, for suggestions."""
        kinds = {option.name: option.kind for option in self.options}
        texts = []
        for name, value in {**self._given, **config}.items():
            if name not in kinds:
                near = did_you_mean(name, [*kinds, "segment", *loop])
                own = f": its own are {', '.join([*kinds][:5])}" if kinds else ": it has none"
                raise InvalidArgument(f"robot '{self.name}' has no option '{name}'{near or own}")
            if kinds[name] in ("number", "integer", "seed") and not isinstance(value, numbers.Real):
                raise InvalidArgument(
                    f"option '{name}' of robot '{self.name}' must be a {kinds[name]}, got {value!r}"
                )
            texts.append((name, face_text(value) if kinds[name] == "face" else text_of(value)))
        return texts

    def __reduce__(self) -> tuple[Any, ...]:
        return load, (self._announced or os.fspath(self.path),)

    def __repr__(self) -> str:
        return f"<o80.robots.Robot '{self.name}' of {self.path}>"


class PythonRobot(Robot):
    """A driver class in Python. Its process is a Python program."""

    def __init__(self, driver: str | type[Any]) -> None:
        """driver: the class, or its place ("module:Class"). Raises DriverError if unusable."""
        from o80.drivers.driver_class import found, library_of

        self._class = found(driver) if isinstance(driver, str) else driver
        super().__init__(library_of(self._class, driver if isinstance(driver, str) else None))

    @property
    def path(self) -> Path:
        """Path of the file with the class."""
        return Path(inspect.getsourcefile(self._class) or self._class.__module__)

    @property
    def _program(self) -> builtins.list[str | Path]:
        place = self._library.path
        if not place:
            raise DriverError(
                f"{self._class.__name__} was typed in, so another process cannot import it: write "
                "it into a file, or use inline()"
            )
        return [sys.executable, "-u", "-m", "o80.run_driver", place]

    @property
    def _environment(self) -> dict[str, str]:
        """Environment of this process, with its import folders in PYTHONPATH."""
        folders = [folder or os.getcwd() for folder in sys.path]
        return {**os.environ, "PYTHONPATH": os.pathsep.join(folders)}

    def __reduce__(self) -> tuple[Any, ...]:
        return load, (self._class,)
