"""Runs the server of a page until a signal, or the end of the standard input."""

import contextlib
import os
import resource
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

from o80.base.stop_request import StopRequest
from o80.view.answers import Answers
from o80.view.server import PageServer
from o80.view.source_list import SourceList

HOST = "127.0.0.1"
DESCRIPTORS = 4096  # enough for many strangers; the usual limit is 1024


@contextmanager
def page_server(
    names: Sequence[str],
    *,
    host: str = HOST,
    port: int = 0,
    control: bool = False,
    model_files: bool = False,
) -> Iterator[PageServer]:
    """Runs a server in threads of its own until the block ends.

    Raises o80.Error if the port is taken, RecordingError if a file cannot be read.
    """
    allow_descriptors(DESCRIPTORS)
    sources = SourceList(names, model_files=model_files)
    answers = Answers(sources, control=control)
    server = PageServer(
        host, port, {"/look": answers.look, "/halt": answers.halt, "/resume": answers.resume}
    )
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    with ThreadPoolExecutor(1) as preparing:  # its imports must not outlive the interpreter
        preparing.submit(answers.look, {})  # reads the models while the browser opens the page
        try:
            yield server
        finally:
            server.close()
            thread.join()


def allow_descriptors(wanted: int) -> None:
    """Raises the descriptor limit of this process to `wanted`, as far as its user may."""
    now, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    allowed = wanted if most == resource.RLIM_INFINITY else min(wanted, most)
    if now != resource.RLIM_INFINITY and now < allowed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, most))


def wait_for_end(*, until_eof: bool) -> None:
    """Returns after Ctrl-C or SIGTERM, or when the standard input ends."""
    end = StopRequest()
    if until_eof:

        def read() -> None:
            with contextlib.suppress(OSError):
                while os.read(sys.stdin.fileno(), 1 << 10):
                    pass
            end.requested = True

        threading.Thread(target=read, daemon=True).start()
    while not end.requested:
        end.wait(0.5)
