"""Driver of cameras and films by OpenCV: video4linux devices, network streams, files."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from o80.base.arrays import Image
from o80.base.descriptors import above_standard
from o80.base.extras import needed
from o80.drivers import Reading, option
from o80.errors import InvalidArgument
from o80_devices.trouble import Trouble

AGAIN = 0.5  # interval between attempts to open a camera [s]
KERNEL_ERROR = 1_000_000  # of kernel stamps: begin or end of a transfer, by driver [ns]


class NewestFrame:
    """Receives frames of one camera in a thread and keeps the newest: no buffer holds old ones."""

    def __init__(self, cv2: Any, source: str, shape: tuple[int, int, int]) -> None:
        self._cv2 = cv2
        self._source = int(source) if source.isdigit() else source
        self._shape = shape
        self._lock = threading.Lock()
        self._newest: tuple[Image, int, int] | None = None
        self._last = 0  # arrival [ns]
        self._trouble = Trouble(f"camera {source}")
        self.wrong = ""
        """Failure of the camera, as a text for the user; empty: none."""
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def take(self) -> tuple[Image, int, int] | None:
        """Returns a new frame, its time and the error of that [ns]; None: no new one."""
        with self._lock:
            newest, self._newest = self._newest, None
        return newest

    def close(self) -> None:
        self._ends.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        while not self._ends.is_set():
            with above_standard():
                capture = self._cv2.VideoCapture(self._source)
            self._set_up(capture)
            while not self._ends.is_set():
                read, frame = capture.read()
                if not read:
                    self._trouble.tell("gives no image: it is unplugged, or another program has it")
                    break
                self._trouble.is_over()
                self._keep(frame, *self._time_of(capture))
            capture.release()
            self._ends.wait(AGAIN)

    def _set_up(self, capture: Any) -> None:
        height, width, _ = self._shape
        capture.set(self._cv2.CAP_PROP_FRAME_WIDTH, width)
        capture.set(self._cv2.CAP_PROP_FRAME_HEIGHT, height)
        capture.set(self._cv2.CAP_PROP_BUFFERSIZE, 1)

    def _time_of(self, capture: Any) -> tuple[int, int]:
        """Returns the kernel's capture time, else the arrival time, and its error [ns]."""
        now = time.monotonic_ns()
        between, self._last = now - self._last, now
        stamp = int(1e6 * float(capture.get(self._cv2.CAP_PROP_POS_MSEC)))
        if 0 <= now - stamp < 1_000_000_000:
            return stamp, KERNEL_ERROR
        return now, min(between, 1_000_000_000)

    def _keep(self, frame: Image, when: int, error: int) -> None:
        if frame.shape != self._shape:
            self.wrong = f"gives images of {frame.shape}, not {self._shape}"
            return
        with self._lock:
            self._newest = frame, when, error


class VideoCameras:
    """Publishes the images of several cameras or films in one segment; recorded only if named.

    `valid` marks the cameras with a new image; capture_time is the newest one's, 0 without any.
    Films are played one frame an iteration; their end stops the process.
    """

    units: ClassVar = {"capture_time": "ns", "times": "ns", "errors": "ns"}

    @dataclass
    class Config:
        sources: str = option("0", "numbers of cameras, or files, separated by commas")
        films: bool = option(False, "the sources are films: every frame counts, in order")
        width: int = option(640, "of an image", "px")
        height: int = option(480, "of an image", "px")

    def __init__(self, config: Config) -> None:
        self._config = config
        self._sources = [each.strip() for each in config.sources.split(",") if each.strip()]
        if not self._sources or config.width < 1 or config.height < 1:
            raise InvalidArgument("give at least one source, and a positive width and height")
        self._shape = (config.height, config.width, 3)
        count = len(self._sources)
        self.extended: dict[str, Any] = {
            "capture_time": np.int64,
            "times": (np.int64, (count,)),
            "errors": (np.int64, (count,)),
            "valid": (np.bool_, (count,)),
            "images": (np.uint8, (count, config.height * config.width * 3)),
        }
        self._cameras: list[NewestFrame] = []
        self._films: list[Any] = []

    def start(self) -> None:
        cv2 = needed("cv2", "cameras", "a camera", package="o80-devices")
        # OpenCV warns at each attempt to open a missing camera; Trouble reports once
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
        if not self._config.films:
            self._cameras = [NewestFrame(cv2, each, self._shape) for each in self._sources]
            return
        for source in self._sources:
            with above_standard():
                film = cv2.VideoCapture(source)
            if not film.isOpened():
                raise InvalidArgument(f"the film {source} cannot be opened")
            self._films.append(film)

    def read(self, reading: Reading) -> None:
        if self._films:
            frames = self._film_frames(reading)
        else:
            frames = [camera.take() for camera in self._cameras]
            for source, camera in zip(self._sources, self._cameras, strict=True):
                if camera.wrong:
                    reading.halt(f"camera {source} {camera.wrong}: set --width and --height")
        row = reading.extended
        row["valid"] = [frame is not None for frame in frames]
        row["times"] = [0 if frame is None else frame[1] for frame in frames]
        row["errors"] = [0 if frame is None else frame[2] for frame in frames]
        row["capture_time"] = row["times"].max()
        for into, frame in zip(row["images"], frames, strict=True):
            if frame is None:
                into[...] = 0  # never an old image
            else:
                into.reshape(self._shape)[...] = frame[0][..., ::-1]  # blue first => red first

    def _film_frames(self, reading: Reading) -> list[tuple[Image, int, int] | None]:
        frames: list[tuple[Image, int, int] | None] = []
        for source, film in zip(self._sources, self._films, strict=True):
            read, frame = film.read()
            if read and frame.shape != self._shape:
                reading.fault(f"the film {source} has frames of {frame.shape}, not {self._shape}")
            frames.append((frame, max(1, reading.time), 0) if read else None)
        if all(frame is None for frame in frames):
            reading.finish()
        return frames

    def stop(self) -> None:
        for camera in self._cameras:
            camera.close()
        for film in self._films:
            film.release()
