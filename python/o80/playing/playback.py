"""Plays a recording: publishes its segments in shared memory again, from a thread."""

import math
import os
import threading
import time
from collections.abc import Mapping, Sequence

import numpy as np

from o80.base import lifecycle
from o80.base.argument_checks import whole
from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.base.lifecycle import Closeable
from o80.playing.player import Player
from o80.playing.track import Part, Track

NEVER = 2**62  # later than any time [ns]


class Playback(Closeable):
    """Plays segments of a recording until the end of its `with` block.

    with o80.play("run.mcap", prefix="old-"):
        arm = o80.Frontend("old-arm")

    Readers get the rows as during the recording; commands, requests and halts are refused.
    `o80.play` is another name of this class.

    segments: names of the segments to play (None: all).
    speed: 0.5 is half as fast as recorded; math.inf is as fast as it can be.
    bursts: rows are published when a frontend requests iterations, as by a bursting robot.
    loop: begin again after the last row, like a restarted robot.
    begin, end: play only this part, in seconds since the first row of the recording.
    prefix: put before the names of the segments, for example if the robots run.
    names: a mapping from recorded names to others.
    history: rows that each segment keeps (None: all of a run, 64 MiB at most).
    permission: as for `o80.robots.Robot.start`; commands are refused in any case.
    hold: keep the segments after the last row until `close` (None: if speed is math.inf). With
        `bursts`, a run ends when a frontend requests more iterations than the run has.

    At speed 1 a constant is added to the row times of robots in real time, so that each row has
    the time at which it is published; ages and rates are right. In all other cases rows are exactly
    as recorded, and their clock counts as simulated.

    Playing runs in a thread. Raises RecordingError for an unreadable file, InvalidArgument, and
    SegmentTaken if the name is that of a living robot or leads to the last rows of a killed one.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        segments: str | Sequence[str] | None = None,
        *,
        speed: float = 1.0,
        bursts: bool = False,
        loop: bool = False,
        begin: float = 0.0,
        end: float | None = None,
        prefix: str = "",
        names: Mapping[str, str] | None = None,
        history: int | None = None,
        permission: int = 0o600,
        hold: bool | None = None,
    ) -> None:
        needed("mcap", "record", "playing a recording")
        _check(speed, begin, end, history)
        self._speed, self._bursts, self._loop = speed, bursts, loop
        self._hold = hold if hold is not None else math.isinf(speed) and not bursts
        tracks = _tracks(path, segments)
        whole_range = [track.time_range for track in tracks]
        first = min(one for one, _ in whole_range)
        last = max(two for _, two in whole_range)
        self._begin = first + round(begin * 1e9)
        self._end = NEVER if end is None else first + round(min(end * 1e9, NEVER))
        self.duration = max(0, min(last, self._end) - self._begin) * 1e-9  #: [s] at speed 1
        if self.duration == 0 and not any(
            begin <= self._end and end >= self._begin
            for begin, end in (track.time_range for track in tracks)
        ):
            raise InvalidArgument(f"{path} has no row in the requested part")
        self._now = self._begin
        self._over = threading.Event()
        self._lock = threading.Lock()
        self._served = 0  # tracks whose last row was published
        self._stopping = False
        self._failure: BaseException | None = None
        self._players: list[Player] = []
        try:
            for track in tracks:
                name = (names or {}).get(track.name, prefix + track.name)
                self._players.append(
                    Player(
                        track,
                        name,
                        bursting=bursts,
                        real_time=speed == 1.0 and not bursts,
                        history=history,
                        permission=permission,
                    )
                )
        except BaseException:
            self._end_all()
            raise
        lifecycle.close_later(self)
        self._thread = threading.Thread(target=self._play, name="o80-playback", daemon=True)
        self._thread.start()

    # ------------------------------------------------------------------ for users

    @property
    def names(self) -> list[str]:
        """Names of the segments that this playback publishes."""
        return [player.name for player in self._players]

    @property
    def rows(self) -> int:
        """Rows published so far."""
        return sum(player.rows for player in self._players)

    @property
    def position(self) -> float:
        """Time of the newest row since the beginning of the played part [s]."""
        return max(0, self._now - self._begin) * 1e-9

    @property
    def done(self) -> bool:
        """True after the last row was published."""
        return self._over.is_set()

    def wait(self, timeout: float | None = None) -> bool:
        """Waits until the last row is published; False if that took longer than `timeout` [s].

        Raises the exception that ended it early, for example SegmentTaken if a robot took the name
        between two runs.
        """
        done = self._over.wait(timeout)
        if self._failure is not None:
            raise self._failure
        return done

    def close(self) -> None:
        """Ends the segments; may be called twice."""
        self._stopping = True
        for player in self._players:
            player.stop()
        if self._thread is not threading.current_thread():
            self._thread.join()
        self._end_all()

    def _leave(self, error: BaseException | None) -> None:
        self.close()
        if error is None and self._failure is not None:
            raise self._failure

    # ------------------------------------------------------------------ the thread

    def _play(self) -> None:
        try:
            while True:
                (self._play_by_bursts if self._bursts else self._play_by_time)()
                if not self._loop or self._stopping or self._failure is not None:
                    break
                for player in self._players:
                    player.begin(0)
        except BaseException as error:  # raised by wait and by the end of the `with` block
            self._failure = error
        finally:
            if not self._hold:
                self._end_all()
            self._over.set()

    def _play_by_time(self) -> None:
        """Publishes the rows of all tracks in the order of their times."""
        start = time.monotonic_ns()
        streams = [player.track.parts(self._begin, self._end) for player in self._players]
        heads: dict[int, Part] = {}
        for i, stream in enumerate(streams):
            if (part := next(stream, None)) is not None:
                heads[i] = part
        while heads and not self._stopping:
            i = min(heads, key=lambda each: int(heads[each].wall[0]))
            others = min((int(heads[each].wall[0]) for each in heads if each != i), default=NEVER)
            part = heads.pop(i)
            count = int(np.searchsorted(part.wall, others, side="right"))
            part, rest = part.split(max(1, count))
            if not self._players[i].publish(part, self._due(part, start)):
                return
            self._now = int(part.wall[-1])
            following = rest if rest is not None else next(streams[i], None)
            if following is not None:
                heads[i] = following
            if (following is None and not self._hold) or (
                following is not None and following.run != part.run
            ):
                self._players[i].end()

    def _due(self, part: Part, start: int) -> np.ndarray[tuple[int], np.dtype[np.int64]] | None:
        """Returns when to publish each row, on the monotonic clock [ns]; None: at once."""
        if math.isinf(self._speed):
            return None
        since = part.wall - self._begin
        return start + (since if self._speed == 1.0 else (since / self._speed).astype(np.int64))

    def _play_by_bursts(self) -> None:
        """Serves each track in a thread of its own, which waits for bursts."""
        threads = [
            threading.Thread(target=self._serve, args=(player,), daemon=True)
            for player in self._players
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _serve(self, player: Player) -> None:
        try:
            stream = player.track.parts(self._begin, self._end)
            part = next(stream, None)
            while part is not None and player.serve(part):
                self._now = max(self._now, int(part.wall[-1]))
                following = next(stream, None)
                if following is None:
                    self._note_served()
                if following is None or following.run != part.run:
                    player.end_at_burst()
                part = following
        except BaseException as error:
            self._failure = error
            self._stopping = True
            for each in self._players:
                each.stop()

    def _note_served(self) -> None:
        """Counts a track that published its last row; the last one ends playback, if not looped."""
        with self._lock:
            self._served += 1
            if self._served == len(self._players) and not self._loop:
                self._over.set()

    def _end_all(self) -> None:
        for player in self._players:
            player.end()


def _tracks(path: str | os.PathLike[str], segments: str | Sequence[str] | None) -> list[Track]:
    """Returns the tracks of these segments. Raises InvalidArgument for an unknown segment."""
    from o80.recording.reader import RecordingFile

    file = RecordingFile(path)
    wanted = [segments] if isinstance(segments, str) else segments
    tracks = [Track(name, file[name].epochs) for name in file.chosen(wanted)]
    tracks = [track for track in tracks if track.epochs]
    if not tracks:
        raise InvalidArgument(f"{path} has no row to play: no robot ran meanwhile")
    return tracks


def _check(speed: float, begin: float, end: float | None, history: int | None) -> None:
    if not speed > 0:
        raise InvalidArgument(f"speed must be positive, got {speed:g}")
    if not (begin >= 0 and math.isfinite(begin * 1e9)):
        raise InvalidArgument(f"begin must be a number of seconds from 0, got {begin:g}")
    if end is not None and not end > begin:
        raise InvalidArgument(f"end must be later than begin ({begin:g} s), got {end:g} s")
    if history is not None and whole(history, "history", 1) >= 2**63:
        raise InvalidArgument(f"history must be less than 2^63 rows, got {history}")


play = Playback
