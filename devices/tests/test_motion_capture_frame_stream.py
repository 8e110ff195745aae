"""The thread that receives frames outlives whatever a connection does."""

import threading
import time

import pytest

import o80
from o80_devices.motion_capture.frame import Frame
from o80_devices.motion_capture.frame_stream import LONGEST_RETRY, FrameStream
from o80_devices.motion_capture.qualisys import Qualisys

WAIT = 60_000_000_000  # [ns] longer than anything here takes


class Connection:
    """Gives one frame, or fails."""

    patience = 1.0

    def __init__(self, failure: Exception | None) -> None:
        self._failure = failure

    def receive(self, timeout: float) -> Frame | None:
        if self._failure is not None:
            raise self._failure
        return Frame(1, 1, time.monotonic_ns(), {})

    def close(self) -> None:
        pass


def first_frame(device: str, *failures: Exception) -> Frame | None:
    """The first frame after connections that fail like this."""
    connections = map(Connection, failures)
    stream = FrameStream(lambda: next(connections, Connection(None)), device)
    stream.start()
    try:
        return stream.next(time.monotonic_ns() + WAIT)
    finally:
        stream.stop()


@pytest.mark.parametrize(
    "failure", [OSError(), ValueError(), TypeError(), OverflowError(), AttributeError()]
)
def test_a_connection_that_fails_is_opened_again(failure: Exception) -> None:
    assert first_frame("device", failure) is not None


def test_a_failure_is_told_once_and_so_is_its_end(capfd: pytest.CaptureFixture[str]) -> None:
    assert first_frame("camera system", *3 * [OSError("no route")]) is not None
    told = capfd.readouterr().err.splitlines()
    assert told == [
        "o80: camera system: no route; tries again",
        "o80: camera system: works again",
    ]


class Watch(threading.Event):
    """Does not wait, but writes down for how long it should."""

    def __init__(self, attempts: int) -> None:
        super().__init__()
        self.waited: list[float] = []
        self._attempts = attempts

    def wait(self, timeout: float | None = None) -> bool:
        self.waited.append(timeout or 0.0)
        if len(self.waited) == self._attempts:
            self.set()
        return self.is_set()


def test_attempts_that_go_on_failing_become_rarer() -> None:
    def refuse() -> Connection:
        raise OSError("no")

    stream = FrameStream(refuse, "device", LONGEST_RETRY)
    watch = stream._stopping = Watch(7)
    stream._run()
    assert watch.waited == [0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]


def test_a_frame_makes_the_next_attempt_soon_again() -> None:
    class Once(Connection):
        def receive(self, timeout: float) -> Frame | None:
            frame, self._failure = super().receive(timeout), OSError("gone")
            return frame

    connections = iter([Connection(OSError()), Connection(OSError()), Once(None)])
    stream = FrameStream(lambda: next(connections, Connection(OSError())), "device", LONGEST_RETRY)
    watch = stream._stopping = Watch(4)
    stream._run()
    assert watch.waited == [0.2, 0.4, 0.2, 0.4]


@pytest.mark.parametrize("port", [-1, 0, 70_000])
def test_a_port_out_of_range_is_told(port: int) -> None:
    with pytest.raises(o80.InvalidArgument, match="port must be"):
        Qualisys(Qualisys.Config(port=port))
