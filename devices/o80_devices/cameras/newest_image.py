"""The newest image of a GenICam camera, received by a thread."""

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
"""For an image, before the thread looks whether it is to stop [s]."""
SILENCE = 1.0
"""Without an image, after which a camera without a trigger is opened again [s]."""
RETRY = 0.3
"""Between two attempts to open a camera [s]."""
FRAME_NUMBERS = 65535
"""GigE Vision counts frames from 1 to this."""


class CameraReason(IntEnum):
    """Why a camera has no image in a row."""

    seen = 0
    """The row has its image."""
    no_new_image = 1
    """None has come since the last row; the next one is not late yet."""
    silent = 2
    """None for longer than the option silent_after: the cable, the trigger, or the camera."""
    damaged = 3
    """Parts of the image were lost on the way."""
    connecting = 4
    disconnected = 5
    """It was not found, is used by another program, or is gone."""


@dataclass(frozen=True)
class Taken:
    image: Image
    """(height, width, 3)"""
    capture: Capture
    stamp: int
    number: int


class Arrivals:
    """Lets the loop wait for the threads of all cameras."""

    def __init__(self) -> None:
        self.changed = threading.Condition()


class NewestImage:
    """The newest image of one camera.

    Writer: its thread, which opens the camera again whenever it fails.
    Reader: the loop, which never waits for the camera.
    """

    def __init__(
        self, name: str, settings: aravis.Settings, latency: float, arrivals: Arrivals
    ) -> None:
        self._name, self._settings, self._arrivals = name, settings, arrivals
        self._clock = ClockMap(latency=latency)
        self._newest: Taken | None = None
        self._state = CameraReason.connecting
        self._last = 0  # arrival [ns]
        self._last_number: int | None = None
        self._trouble = Trouble(f"camera {name}")
        self.lost = 0
        """Frames that the camera counted and that did not arrive whole."""
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"camera {name}", daemon=True)
        self._thread.start()

    @property
    def has_new(self) -> bool:
        return self._newest is not None

    def take(self, now: int, gap: int) -> tuple[Taken | None, CameraReason]:
        """The image, once. now: on the monotonic clock [ns]. gap: that is silence [ns]."""
        with self._arrivals.changed:
            newest, self._newest = self._newest, None
            state, last = self._state, self._last
        if newest is not None:
            return newest, CameraReason.seen
        if state is CameraReason.seen:
            return None, CameraReason.silent if now - last > gap else CameraReason.no_new_image
        return None, state

    def end(self) -> None:
        """Asks the thread to end; `close` waits for it."""
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
                    self._say(CameraReason.disconnected)
                    camera.abandon()
                    raise
                camera.close()
            except Exception as error:
                # whatever a camera does wrong: it is opened again
                self._trouble.tell(str(error) or type(error).__name__)
            self._say(CameraReason.disconnected)
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
                camera.check()  # it may wait for its trigger
                last = time.monotonic()

    def _keep(self, buffer: aravis.Buffer, arrival: int) -> None:
        self._count(buffer.number)
        if buffer.status != aravis.SUCCESS:
            self.lost += 1
            self._say(CameraReason.damaged)
            why = aravis.STATUS.get(buffer.status, f"status {buffer.status}")
            self._trouble.tell(f"an image is damaged: {why}")
            return
        if buffer.size != self._settings.region[2:]:
            raise ValueError(f"its images have {buffer.size} pixels: set --width and --height")
        image = rgb_of(buffer.content, buffer.size, self._settings.pixel_format)  # type: ignore[arg-type]
        capture = Capture(arrival, 0, 0)
        if buffer.stamp:
            mapped = self._clock.capture(buffer.stamp, arrival)
            if mapped is None:
                return  # older than the last one
            capture = mapped
        self._trouble.is_over()
        with self._arrivals.changed:
            self._newest = Taken(image, capture, buffer.stamp, buffer.number)
            self._state, self._last = CameraReason.seen, arrival
            self._arrivals.changed.notify_all()

    def _count(self, number: int) -> None:
        """Frames that are missing between the last number and this one."""
        before, self._last_number = self._last_number, number
        if before is None:
            return
        missing = number - before - 1
        if missing < 0 and before <= FRAME_NUMBERS:
            missing += FRAME_NUMBERS
        if 0 < missing < FRAME_NUMBERS // 2:
            self.lost += missing

    def _say(self, state: CameraReason) -> None:
        with self._arrivals.changed:
            self._state = state
