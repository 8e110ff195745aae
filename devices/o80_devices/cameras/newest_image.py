"""Receives the newest image of a GenICam camera in a thread."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from enum import IntEnum

from o80.base.arrays import Image
from o80.base.descriptors import above_standard
from o80_devices.cameras import aravis
from o80_devices.cameras.pixel_formats import rgb_of
from o80_devices.clock import Capture, ClockMap
from o80_devices.trouble import Trouble

WAIT = 0.05
"""Timeout of one wait for an image; then the stop flag is checked [s]."""
SILENCE = 1.0
"""Time without an image after which a camera without a trigger is reopened [s]."""
RETRY = 0.3
"""Interval between attempts to open a camera [s]."""
FRAME_NUMBERS = 65535
"""Largest frame number of GigE Vision, which counts from 1."""


class CameraReason(IntEnum):
    """Reason why a camera has no image in a row."""

    seen = 0
    """The row has its image."""
    no_new_image = 1
    """No image since the last row; the next one is not late yet."""
    silent = 2
    """No image for longer than the option silent_after: check cable, trigger and camera."""
    damaged = 3
    """Parts of the image were lost in transmission."""
    connecting = 4
    disconnected = 5
    """The camera was not found, is used by another program, or was disconnected."""


@dataclass(frozen=True)
class Taken:
    image: Image
    """(height, width, 3)"""
    capture: Capture
    stamp: int
    number: int


class NewestImage:
    """Holds the newest image of one camera.

    Writer: a thread, which reopens the camera after each failure.
    Reader: the loop, which never waits for the camera.
    """

    def __init__(
        self, name: str, settings: aravis.Settings, latency: float, arrived: threading.Condition
    ) -> None:
        """arrived: condition by which the loop waits for the threads of all cameras."""
        self._name, self._settings, self._arrived = name, settings, arrived
        self._clock = ClockMap(latency=latency)
        self._newest: Taken | None = None
        self._state = CameraReason.connecting
        self._last = 0  # arrival [ns]
        self._last_number: int | None = None
        self._trouble = Trouble(f"camera {name}")
        self.lost = 0
        """Number of frames that were missing or damaged."""
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"camera {name}", daemon=True)
        self._thread.start()

    @property
    def has_new(self) -> bool:
        return self._newest is not None

    def take(self, now: int, gap: int) -> tuple[Taken | None, CameraReason]:
        """Returns an image once. now: monotonic time [ns]. gap: limit of silence [ns]."""
        with self._arrived:
            newest, self._newest = self._newest, None
            state, last = self._state, self._last
        if newest is not None:
            return newest, CameraReason.seen
        if state is CameraReason.seen:
            return None, CameraReason.silent if now - last > gap else CameraReason.no_new_image
        return None, state

    def end(self) -> None:
        """Requests the thread to end; `close` waits for the end."""
        self._ends.set()

    def close(self) -> None:
        self.end()
        self._thread.join(timeout=2.0)

    # ------------------------------------------------------------------ the thread

    def _run(self) -> None:
        while not self._ends.is_set():
            try:
                with above_standard():
                    camera = aravis.Camera(self._name, self._settings)
                try:
                    self._receive_from(camera)
                except BaseException:
                    self._set_state(CameraReason.disconnected)
                    camera.abandon()
                    raise
                camera.close()
            except Exception as error:
                # any failure: the camera is reopened
                self._trouble.tell(str(error) or type(error).__name__)
            self._set_state(CameraReason.disconnected)
            self._ends.wait(RETRY)

    def _receive_from(self, camera: aravis.Camera) -> None:
        self._clock.restarted()
        self._last_number = None
        last = time.monotonic()
        while not self._ends.is_set():
            buffer = camera.pop(WAIT)
            if buffer is not None:
                last = time.monotonic()
                self._keep(buffer, time.monotonic_ns())
            elif time.monotonic() - last > SILENCE:
                if not self._settings.trigger:
                    raise TimeoutError(f"it has sent no image for {SILENCE:g} s")
                camera.check()  # the camera may be waiting for a trigger
                last = time.monotonic()

    def _keep(self, buffer: aravis.Buffer, arrival: int) -> None:
        self._count(buffer.number)
        if buffer.status != aravis.SUCCESS:
            self.lost += 1
            self._set_state(CameraReason.damaged)
            why = aravis.STATUS.get(buffer.status, f"status {buffer.status}")
            self._trouble.tell(f"an image is damaged ({why}): check cable and network")
            return
        if buffer.size != self._settings.region[2:]:
            width, height = buffer.size
            raise ValueError(f"its images need --width {width} and --height {height}")
        image = rgb_of(buffer.content, buffer.size, self._settings.pixel_format)  # type: ignore[arg-type]
        capture = Capture(arrival, 0, 0)
        if buffer.stamp:
            mapped = self._clock.capture(buffer.stamp, arrival)
            if mapped is None:
                return  # older than the last one
            capture = mapped
        self._trouble.is_over()
        with self._arrived:
            self._newest = Taken(image, capture, buffer.stamp, buffer.number)
            self._state, self._last = CameraReason.seen, arrival
            self._arrived.notify_all()

    def _count(self, number: int) -> None:
        """Adds the frames that are missing between the last number and this one to `lost`."""
        before, self._last_number = self._last_number, number
        if before is None:
            return
        missing = number - before - 1
        if missing < 0 and before <= FRAME_NUMBERS:
            missing += FRAME_NUMBERS
        if 0 < missing < FRAME_NUMBERS // 2:
            self.lost += missing

    def _set_state(self, state: CameraReason) -> None:
        with self._arrived:
            self._state = state
