"""A page in the browser, served by a process of its own."""

import json
import os
import select
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from o80.base import lifecycle
from o80.base.child_process import end_child, start_child
from o80.base.errors import Error, InvalidArgument, TimeoutError
from o80.base.finite import json_text
from o80.base.lifecycle import Closeable
from o80.frontend.frontend import Frontend
from o80.recording.reader import RecordingFile
from o80.view.browser import open_browser as open_in_browser

GRACE = 5.0  # [s] for the server to stop
STARTS_WITHIN = 30.0  # [s]

What = str | Path | Frontend | RecordingFile


class View(Closeable):
    """A page in the browser that shows robots and recordings: `o80 view` for programs.

    what: names of segments, patterns such as "arm*", paths of recordings (.mcap), frontends, or
        recordings; one or several. Without any: all segments.
    host: address to listen on. The default is reachable from this computer only.
    port: 0 is any free one.
    control: pages may resume a halted robot. They may always halt.
    open_browser: also opens the page.
    model_files: read the files (meshes) that models of recordings and of other users' robots name.

    The server is a process of its own, to cost this process no time. It ends with `close`, the
    `with` block or this process. Raises Error for a taken port, RecordingError for a bad file.
    """

    def __init__(
        self,
        *what: What | Iterable[What],
        host: str = "127.0.0.1",
        port: int = 0,
        control: bool = False,
        open_browser: bool = False,
        model_files: bool = False,
    ) -> None:
        self._owner = os.getpid()
        names = [_name(each) for group in what for each in _several(group)]
        options = {
            "names": names,
            "host": host,
            "port": port,
            "control": control,
            "model_files": model_files,
        }
        command = [sys.executable, "-m", "o80.view", json_text(options)]
        self._popen = start_child(command, stdout=subprocess.PIPE)
        lifecycle.close_later(self)
        try:
            said = self._first_line()
        except BaseException:
            self.close()
            raise
        if "error" in said:
            self.close()
            raise Error(said["error"])
        self.url: str = said["url"]  #: address of the page; its token permits to halt robots
        self.port: int = said["port"]  #: the bound port
        if open_browser:
            open_in_browser(self.url)

    @property
    def alive(self) -> bool:
        """True while the page is served."""
        return self._popen.poll() is None

    def close(self) -> None:
        """Ends the server; pages show that. May be called twice; no effect in a forked child."""
        if self._owner != os.getpid():
            return
        end_child(self._popen, GRACE)
        if self._popen.stdout is not None:
            self._popen.stdout.close()

    def _first_line(self) -> dict[str, Any]:
        assert self._popen.stdout is not None
        ready, _, _ = select.select([self._popen.stdout], [], [], STARTS_WITHIN)
        if not ready:
            raise TimeoutError(f"the view did not start within {STARTS_WITHIN:g} s")
        line = self._popen.stdout.readline()
        if not line:
            raise Error(f"the view ended with exit code {self._popen.wait()} before it was ready")
        said: dict[str, Any] = json.loads(line)
        return said

    def __repr__(self) -> str:
        return f"<o80.View on port {self.port}, {'open' if self.alive else 'closed'}>"


def _several(what: What | Iterable[What]) -> Iterable[What]:
    return (what,) if isinstance(what, (str, Path, Frontend, RecordingFile)) else what


def _name(what: Any) -> str:
    if isinstance(what, Frontend):
        return what.segment
    path = what.path if isinstance(what, RecordingFile) else what
    if not isinstance(path, (str, Path)):
        raise InvalidArgument(
            f"a view shows names of segments, recordings and frontends, got {what!r}"
        )
    return str(path)
