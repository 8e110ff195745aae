"""Plays recorded frames at the pace of the motion capture system."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from o80.drivers import option
from o80.errors import InvalidArgument
from o80_devices.motion_capture.frame import Frame
from o80_devices.motion_capture.recorded_frames import RecordedFrames, load
from o80_devices.motion_capture.sensor import SECOND, Reason, Sensor, SensorConfig

MAX_WAITING = 4  # frames


class PlayedFrames:
    """Returns frames at the recorded intervals, once or repeatedly."""

    def __init__(self, file: Path, repeat: bool) -> None:
        self._file = file
        self._repeat = repeat
        self._begin: int | None = None
        self._next = 0
        self._round = 0

    @cached_property
    def _recorded(self) -> RecordedFrames:
        return load(self._file)

    @property
    def names(self) -> list[str]:
        return self._recorded.names

    @property
    def tick(self) -> float:
        return SECOND / self._recorded.rate  # stamps are numbers of frames

    @property
    def reason(self) -> Reason:
        return Reason.ENDED if self._next == len(self._recorded.frames) else Reason.SEEN

    def start(self) -> None:
        self._begin = None
        self._next = self._round = 0

    def stop(self) -> None:
        pass

    def taken(self, now: int) -> Frame | None:
        frames = self._recorded.frames
        if self._begin is None:
            self._begin = now
        if self._next == len(frames) and self._repeat:
            # one frame interval between the rounds
            self._begin += frames[-1].arrival - frames[0].arrival + round(self.tick)
            self._next = 0
            self._round += frames[-1].number - frames[0].number + 1
        late = now - round(MAX_WAITING * self.tick)
        while self._next + 1 < len(frames) and self._arrival(self._next + 1) < late:
            self._next += 1  # a network buffer would have dropped this frame
        if self._next == len(frames) or self._arrival(self._next) > now:
            return None
        frame, arrival = frames[self._next], self._arrival(self._next)
        self._next += 1
        number = frame.number + self._round
        return replace(frame, number=number, stamp=number, arrival=arrival)

    def next(self, deadline: int) -> Frame | None:
        frame = self.taken(time.monotonic_ns())
        if frame is not None:
            return frame
        if self._next < len(self._recorded.frames):
            deadline = min(deadline, self._arrival(self._next))
        time.sleep(max(0, deadline - time.monotonic_ns()) / SECOND)
        return self.taken(time.monotonic_ns())

    def _arrival(self, index: int) -> int:
        frames = self._recorded.frames
        return (self._begin or 0) + frames[index].arrival - frames[0].arrival


class Playback(Sensor):
    """Plays a file of recorded frames."""

    name = "motion_capture"

    @dataclass
    class Config(SensorConfig):
        file: str = option("", "of recorded frames")
        repeat: bool = option(False, "play the file again when it has ended")

    def __init__(self, config: Config) -> None:
        if not config.file:
            raise InvalidArgument("name the recording: --file recording.dat")
        super().__init__(config, PlayedFrames(Path(config.file), config.repeat))
