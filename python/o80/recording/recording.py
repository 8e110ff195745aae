"""Recording from within a program, in a background thread."""

import os
import threading
import warnings
import weakref
from collections.abc import Sequence
from functools import partial
from typing import Any

from o80.base.errors import Closed
from o80.base.lifecycle import Closeable, close_later
from o80.frontend.frontend import Frontend
from o80.recording.file_writer import Form
from o80.recording.recorder import Recorder

BETWEEN_POLLS = 0.05  # [s]


class Recording(Closeable):
    """Records rows and journals of segments in a thread while its `with` block runs.

    with o80.Recording("run.mcap", [arm, "ball"]) as recording:
        recording.mark("episode", number=3)

    path: the file, NAME.mcap, which must not exist.
    segments: names, patterns such as "arm*", or frontends. Recording begins with the oldest rows
        that these segments still hold.
    proceed: continue an existing file, also a truncated one.
    from_now: begin with the newest rows; robots that start later are recorded from their first row.
    split: begin a new file after a size ("500M", "2G") or a time ("600s", "10min", "1h"): `path`
        is then a folder of complete files, which `o80.open` reads as one recording.
    keep: with `split`, largest size of this folder ("50G"): the oldest files of this recording
        are deleted, but none with a mark.
    snapshots: interval of snapshot requests to simulations [s]; a replay can begin from these.
    compression: "zstd", "lz4" or "none".
    joint_states: whether rows of robots with joints are also written as sensor_msgs/JointState.

    Rows that are overwritten before the thread reads them leave a gap: call `flush` between very
    long bursts. Raises RecordingError if the file cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        segments: str | Frontend | Sequence[str | Frontend],
        *,
        proceed: bool = False,
        from_now: bool = False,
        split: str | None = None,
        keep: str | None = None,
        snapshots: float | None = None,
        compression: str = "zstd",
        joint_states: bool = True,
    ) -> None:
        several = [segments] if isinstance(segments, (str, Frontend)) else segments
        names = [each.segment if isinstance(each, Frontend) else each for each in several]
        form = Form(compression, joint_states)
        self._recorder = Recorder(
            path,
            names,
            proceed=proceed,
            from_now=from_now,
            split=split,
            keep=keep,
            snapshots=snapshots,
            form=form,
        )
        self._lock = threading.Lock()
        self._end = threading.Event()
        self._failure: Exception | None = None
        self._closed = False
        self._owner = os.getpid()
        # weak: this object is collected as soon as nothing refers to it
        run = partial(_run, weakref.ref(self), self._end)
        self._thread = threading.Thread(target=run, name="o80-recording", daemon=True)
        self._thread.start()
        close_later(self)

    @property
    def rows(self) -> int:
        """Rows recorded so far."""
        return self._recorder.rows

    @property
    def missed(self) -> int:
        """Number of rows overwritten before they were read; the file notes them as gaps."""
        return self._recorder.missed

    @property
    def size(self) -> int:
        """Size of the recording so far [bytes]."""
        return self._recorder.size

    def flush(self) -> None:
        """Waits until every row that was published before the call is in the file."""
        with self._lock:
            self._check()
            self._recorder.catch_up()

    def mark(self, name: str, /, **values: Any) -> None:
        """Writes a mark: a name and values, with the newest iteration of each segment.

        values: JSON values, and NumPy arrays, which become lists. Raises TypeError for others.
        """
        with self._lock:
            self._check()
            self._recorder.mark(name, **values)

    def close(self) -> None:
        """Records the rows published until now and finishes the file; may be called twice."""
        if self._closed:
            return
        self._closed = True
        self._end.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()
        try:
            if self._failure is None:
                self._recorder.catch_up()
        finally:
            self._recorder.finish()
        if self._failure is not None:
            raise self._failure

    def _check(self) -> None:
        if self._closed:
            raise Closed(f"the recording {self._recorder.path} was closed")
        if self._failure is not None:
            raise self._failure

    def _catch_up(self) -> bool:
        """Records rows if a chunk is due; False if that failed."""
        try:
            with self._lock:
                if self._recorder.is_due():
                    self._recorder.catch_up()
        except Exception as error:  # raised by the next call, at the latest by close
            self._failure = error
        return self._failure is None

    def __del__(self) -> None:
        # in a forked child the file belongs to the parent
        if hasattr(self, "_thread") and not self._closed and self._owner == os.getpid():
            path = self._recorder.path
            warnings.warn(f"the recording {path} was never closed", ResourceWarning, stacklevel=2)
            self.close()


def _run(recording: "weakref.ref[Recording]", end: threading.Event) -> None:
    while not end.wait(BETWEEN_POLLS):
        alive = recording()
        if alive is None or not alive._catch_up():
            return
        del alive
