"""The nine processes of the lab, and the counterpart of the devices: what each is, how it starts.

Every command is one that a user could type: `o80 run`, `o80 record`, `o80 view`, or a module of
this package.
"""

from __future__ import annotations

import socket
import sys
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from o80.base.loop_options import text_of

from ..rig.rig import arm_options, world_options
from ..settings import RigSettings
from ..world.timing import PERIOD
from .processes import Part

ARM, WORLD, LAUNCHER, CAMERAS = "arm", "world", "launcher", "cameras"
TRACKER, MOTION_CAPTURE, ENVIRONMENT = "tracker", "motion_capture", "environment"
RECORDER, VIEW, COUNTERPARTS = "recorder", "view", "counterparts"
NINE = (
    *(ARM, WORLD, LAUNCHER, CAMERAS, TRACKER),
    *(MOTION_CAPTURE, ENVIRONMENT, RECORDER, VIEW),
)
"""The processes of the lab; the four cameras are one."""
LAUNCHES = "launches"
"""Segment of the counterparts: the balls that have left the launcher, as its model drew them."""
RATES = {ARM: 500.0, LAUNCHER: 50.0, CAMERAS: 180.0, TRACKER: 180.0, MOTION_CAPTURE: 300.0} | {
    ENVIRONMENT: 100.0
}
"""Rows a second."""
CAMERAS_ROBOT = "o80_devices.ball_tracking:SyntheticCameras"
TRACKER_ROBOT = "o80_devices.ball_tracking:BallTracker"
SUBJECTS = ("racket", "base", "table")
"""Subjects that the motion capture sees."""
RECORDED = (ARM, WORLD, LAUNCHER, TRACKER, MOTION_CAPTURE, ENVIRONMENT)
"""No images."""
LOGS = "processes"
SETS_WITHIN, LAUNCHES_WITHIN = 0.1, 0.4
"""Time that the fake launcher takes to set its motors, and for a launch [s]."""


@dataclass(frozen=True)
class LabSettings:
    """Settings of the lab: what is played, and where it is written."""

    balls: int = 5
    """To play; 0: until Ctrl-C."""
    seed: int = 1
    policy: str = "learned"
    """learned or scripted."""
    prefix: str = "lab"
    """Prefix of the names of all segments."""
    folder: Path = Path("build/lab")
    fifo: bool = True
    """Ask for real-time scheduling of the arm and of the motion capture."""
    parts: tuple[str, ...] = NINE
    """Parts that are started."""
    rig: RigSettings = field(default_factory=lambda: RigSettings(preset="identified"))

    def segment(self, part: str) -> str:
        """Name of the segment of a part."""
        return f"{self.prefix}-{part}"

    @property
    def recording(self) -> Path:
        """All rows but the images."""
        return self.folder / "run.mcap"


def lab_parts(settings: LabSettings) -> dict[str, Part]:
    """All parts by name, the counterparts first. Ports are chosen now."""
    launcher, qualisys = f"tcp://127.0.0.1:{free_port()}", free_port()
    of = settings.segment
    parts = [
        Part(
            COUNTERPARTS,
            (
                *_module("counterparts"),
                *flags(
                    launcher=launcher,
                    qualisys=qualisys,
                    arm=of(ARM),
                    launches=of(LAUNCHES),
                    seed=settings.seed,
                ),
            ),
            segment=of(LAUNCHES),
        ),
        _robot(settings, ARM, "pam", _real_time(settings) | arm_options(settings.rig)),
        _robot(
            settings,
            WORLD,
            "mujoco",
            {"frequency": 1.0 / PERIOD, "bursting": True} | world_options(settings.rig),
        ),
        _robot(
            settings,
            LAUNCHER,
            "o80_devices.ball_launcher:BallLauncher",
            {"frequency": RATES[LAUNCHER], "address": launcher, "resume": True},
            needs=(COUNTERPARTS,),
        ),
        _robot(settings, CAMERAS, *_cameras(settings), needs=(WORLD,)),
        _robot(
            settings,
            TRACKER,
            TRACKER_ROBOT,
            {"frequency": RATES[TRACKER], "cameras": of(CAMERAS), "timeout": 60},
            needs=(CAMERAS,),
        ),
        _robot(
            settings,
            MOTION_CAPTURE,
            "o80_devices.motion_capture:Qualisys",
            {
                "frequency": RATES[MOTION_CAPTURE],
                "port": qualisys,
                "subjects": ",".join(SUBJECTS),
                **({"policy": "fifo", "priority": 40} if settings.fifo else {}),
            },
            needs=(COUNTERPARTS,),
        ),
        Part(
            ENVIRONMENT,
            (
                *_module("environment_process"),
                *flags(
                    prefix=settings.prefix,
                    balls=settings.balls,
                    seed=settings.seed,
                    policy=settings.policy,
                ),
            ),
            segment=of(ENVIRONMENT),
            rate=RATES[ENVIRONMENT],
            needs=(ARM, WORLD, TRACKER, LAUNCHER),
        ),
        Part(
            RECORDER,
            (
                *(o80_command(), "record", *(of(part) for part in RECORDED), of(LAUNCHES)),
                *("-o", str(settings.recording), "--continue"),
            ),
            says=f"'{of(ENVIRONMENT)}' ",  # what becomes of its rows
            needs=RECORDED,
            output=settings.recording,
        ),
        Part(
            VIEW,
            (o80_command(), "view", *(of(part) for part in RECORDED), "--no-browser"),
            says="http",
            needs=RECORDED,
        ),
    ]
    return {part.name: part for part in parts if part.name in (*settings.parts, COUNTERPARTS)}


def _real_time(settings: LabSettings) -> dict[str, Any]:
    """How the loop of the arm runs. The arm is simulated: one that was killed goes on at once."""
    options: dict[str, Any] = {"frequency": RATES[ARM], "stale": "purge", "resume": True}
    if settings.fifo:
        options |= {"policy": "fifo", "priority": 80, "lock_memory": True}
    return options


def _cameras(settings: LabSettings) -> tuple[str, dict[str, Any]]:
    options = {
        "frequency": RATES[CAMERAS],
        "history": 4,
        "seed": settings.seed,
        "ball": settings.segment(WORLD),
        "times": settings.segment(ENVIRONMENT),
    }
    return CAMERAS_ROBOT, options


def _robot(
    settings: LabSettings,
    name: str,
    robot: str,
    options: Mapping[str, Any],
    needs: tuple[str, ...] = (),
) -> Part:
    command = (o80_command(), "run", robot, *flags(segment=settings.segment(name), **options))
    return Part(name, command, settings.segment(name), rate=RATES.get(name), needs=needs)


def flags(**options: Any) -> list[str]:
    """Options as words of a command: `--name=text`, switches without a text."""
    words = []
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}" if name in SWITCHES else f"--{name}"
        if name in SWITCHES:
            words += [flag] if value else []
        elif value is not None:
            words.append(f"{flag}={text_of(value)}")
    return words


SWITCHES = ("bursting", "resume", "lock_memory")


def _module(name: str) -> tuple[str, ...]:
    return (sys.executable, "-u", "-m", f"o80_table_tennis.lab.{name}")


def o80_command() -> str:
    """The command `o80` of this installation."""
    return str(Path(sysconfig.get_path("scripts")) / "o80")


def free_port() -> int:
    """A port of this computer that nobody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port
