"""The thread that receives frames outlives whatever a connection does."""

import time

import pytest

import o80
from o80_devices.motion_capture.frame import Frame
from o80_devices.motion_capture.frame_stream import FrameStream
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


@pytest.mark.parametrize(
    "failure", [OSError(), ValueError(), TypeError(), OverflowError(), AttributeError()]
)
def test_a_connection_that_fails_is_opened_again(failure: Exception) -> None:
    connections = iter([Connection(failure)])
    stream = FrameStream(lambda: next(connections, Connection(None)))
    stream.start()
    try:
        assert stream.next(time.monotonic_ns() + WAIT) is not None
    finally:
        stream.stop()


@pytest.mark.parametrize("port", [-1, 0, 70_000])
def test_a_port_out_of_range_is_told(port: int) -> None:
    with pytest.raises(o80.InvalidArgument, match="port must be"):
        Qualisys(Qualisys.Config(port=port))
