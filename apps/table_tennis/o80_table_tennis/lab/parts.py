"""Table of the lab: processes in the order of their start, and the consequences of their deaths.

All commands are ordinary ones: `o80 run`, `o80 record`, `o80 view`, or a module of
this package. The processes end in reverse order.
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

ARM, WORLD, LAUNCHER, CAMERAS = "arm", "world", "launcher", "cameras"
TRACKER, MOTION_CAPTURE, ENVIRONMENT = "tracker", "motion_capture", "environment"
RECORDER, VIEW, COUNTERPARTS = "recorder", "view", "counterparts"
WATCHED = (ARM, WORLD, LAUNCHER, CAMERAS, TRACKER, MOTION_CAPTURE)
"""Parts whose absence is shown in the environment's rows."""
RATES = {ARM: 500.0, LAUNCHER: 50.0, CAMERAS: 180.0, TRACKER: 180.0, MOTION_CAPTURE: 300.0}
RATES[ENVIRONMENT] = 100.0
"""Rows a second."""
RIG = RigSettings(preset="identified")
SUBJECTS = ("racket", "base", "table")
"""Subjects of the motion capture."""
NO_IMAGE, DIED = "`reason` is `no_image`", "journal: `died`"
NO_RACKET = "`racket.visible` is false"
COMMAND = str(Path(sysconfig.get_path("scripts")) / "o80")
"""The command `o80` of this installation."""


@dataclass(frozen=True)
class LabSettings:
    """Settings of the lab, see the options of its command."""

    balls: int = 5
    seed: int = 1
    policy: str = "learned"
    prefix: str = "lab"
    folder: Path = Path("build/lab")
    fifo: bool = True

    def segment(self, part: str) -> str:
        """Name of the segment of a part."""
        return f"{self.prefix}-{part}"

    @property
    def recording(self) -> Path:
        """Path of the recording of all rows but images."""
        return self.folder / "run.mcap"


@dataclass(frozen=True)
class Part:
    """A process of the lab, and the others' reactions when it is killed."""

    name: str
    command: tuple[str, ...]
    segment: str | None = None
    """Name of the backend's segment, which shows whether the part is running."""
    says: str = ""
    """Text that a process without a segment prints when it is running."""
    missed: Mapping[str, str] = field(default_factory=dict)
    """Signs of the absence of this part in the rows of others, by part."""
    halts: tuple[str, ...] = ()
    """Parts that stop until this one is back."""
    besides: str = ""
    """Further consequences."""


def lab_parts(settings: LabSettings) -> dict[str, Part]:
    """Builds the table, and chooses free ports."""
    of, seed = settings.segment, settings.seed
    launcher, qualisys = f"tcp://127.0.0.1:{_free_port()}", _free_port()
    fifo = ("--policy=fifo", "--lock-memory") if settings.fifo else ()
    recorded = [of(part) for part in (*WATCHED, ENVIRONMENT) if part != CAMERAS]
    words = [f"--{key}={getattr(settings, key)}" for key in ("prefix", "balls", "seed", "policy")]
    play = (sys.executable, "-u", "-m", "o80_table_tennis.lab.environment_process", *words)
    record = (COMMAND, "record", *recorded, "-o", str(settings.recording), "--continue")

    def robot(
        name: str, driver: str, options: Mapping[str, Any], *words: str, **death: Any
    ) -> Part:
        given = {"segment": of(name), "frequency": RATES.get(name), **options}.items()
        flags = [f"--{key}={text_of(value)}" for key, value in given if value is not None]
        if name in WATCHED:
            death["missed"] = {ENVIRONMENT: f"`missing.{name}`"} | death.get("missed", {})
        return Part(name, (COMMAND, "run", driver, *flags, *words), of(name), **death)

    blind = {TRACKER: NO_IMAGE}
    parts = (
        robot(
            COUNTERPARTS,
            "o80_table_tennis.lab.counterparts:Counterparts",
            {"launcher": launcher, "qualisys": qualisys, "arm": of(ARM), "seed": seed},
        ),
        robot(
            ARM,
            "pam",
            {"stale": "purge", "priority": 80 if fifo else None, **arm_options(RIG)},
            "--resume",  # simulated: after a kill it continues at once
            *fifo,
            missed=blind | {MOTION_CAPTURE: NO_RACKET},
            halts=(WORLD,),
            besides="the ball is given up; the next one is played when the arm is back",
        ),
        robot(
            WORLD,
            "mujoco",
            {"frequency": 1.0 / PERIOD} | world_options(RIG),
            "--bursting",
            missed=blind,
            besides="the ball is given up; the arm keeps its pressures",
        ),
        robot(
            LAUNCHER,
            "o80_devices.ball_launcher:BallLauncher",
            {"address": launcher},
            "--resume",
            besides="a ball in flight is played to its end; no other one starts",
        ),
        robot(
            CAMERAS,
            "o80_devices.ball_tracking:SyntheticCameras",
            {"history": 4, "seed": seed, "ball": of(WORLD), "times": of(ENVIRONMENT)},
            missed=blind,
        ),
        robot(
            TRACKER,
            "o80_devices.ball_tracking:BallTracker",
            {"cameras": of(CAMERAS), "timeout": 60},
            besides="a ball in flight is played on as the filter of the observation predicts it",
        ),
        robot(
            MOTION_CAPTURE,
            "o80_devices.motion_capture:Qualisys",
            {"port": qualisys, "subjects": SUBJECTS, "priority": 40 if fifo else None},
            *fifo[:1],
        ),
        Part(
            ENVIRONMENT,
            play,
            of(ENVIRONMENT),
            missed={ARM: DIED, TRACKER: NO_IMAGE},
            halts=(WORLD,),
            besides="the arm purges what was asked of it, and keeps its pressures",
        ),
        Part(
            RECORDER,
            record,
            says=f"'{of(ENVIRONMENT)}' ",  # begin of the line about the environment's rows
            besides="started again, it goes on in the same file, without a gap",
        ),
        Part(
            VIEW,
            (COMMAND, "view", *recorded, "--no-browser"),
            says="http",
            besides="started again, it has another address",
        ),
    )
    return {part.name: part for part in parts}


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port
