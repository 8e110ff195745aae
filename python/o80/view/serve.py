"""Runs the server of a page until it is told to stop."""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

from o80.view.answers import Answers
from o80.view.server import PageServer
from o80.view.source_list import SourceList

HOST = "127.0.0.1"


@contextmanager
def page_server(
    names: Sequence[str],
    *,
    host: str = HOST,
    port: int = 0,
    control: bool = False,
    model_files: bool = False,
) -> Iterator[PageServer]:
    """A server that listens, and serves in threads of its own until the block ends.

    Raises o80.Error if the port is taken, RecordingError if a file cannot be read.
    """
    sources = SourceList(names, model_files=model_files)
    answers = Answers(sources, control=control)
    server = PageServer(
        host, port, {"/look": answers.look, "/halt": answers.halt, "/resume": answers.resume}
    )
    thread = threading.Thread(target=server.serve_forever, args=(0.1,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def wait_for_end(*, until_eof: bool) -> None:
    """Returns after Ctrl-C or SIGTERM, or when the standard input ends."""
    end = threading.Event()

    def stop(_number: int, _frame: FrameType | None) -> None:
        end.set()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, stop)
    if until_eof:

        def read() -> None:
            with contextlib.suppress(OSError):
                while os.read(sys.stdin.fileno(), 1 << 10):
                    pass
            end.set()

        threading.Thread(target=read, daemon=True).start()
    while not end.wait(0.5):  # with a timeout, so that the signals are seen
        pass
