"""Sent chunks, and the plan of each."""

import numpy as np

import o80._core as _core
from o80.base.words import Status
from o80.rows.plans import ChunkRows, ChunkWay, Decision, Moment, decide


class SentChunk:
    """A chunk that was sent. `late`, `begins` and `shift` are None until the loop has decided on
    it, `skipped`, `first` and `needed_ease` until it has begun, and all if it was rejected.
    """

    def __init__(self, batch: _core.Batch, sent: ChunkRows) -> None:
        self.batch = batch  #: the batch, with this chunk as its only command
        self._sent = sent
        self._decision: Decision | None = None
        self._take_over: tuple[int, int] | None = None  # first row, needed iterations

    @property
    def clipped(self) -> int:
        """Number of values in its rows that `clip` has moved inside their bounds."""
        return self.batch.clipped

    @property
    def decided(self) -> bool:
        """Whether the backend has taken or rejected it."""
        return self.batch._shift is not None or self.batch.ended

    @property
    def rejected(self) -> bool:
        """Whether it was rejected: `batch[0]` has the reason."""
        return self.batch[0].status == Status.REJECTED

    @property
    def late(self) -> int | None:
        """Number of rows that were due before the chunk was taken, and are skipped."""
        return None if self._decided is None else self._decided.late

    @property
    def skipped(self) -> int | None:
        """Number of rows that are not reached: late rows, and rows that the take-over passes."""
        return None if self._begun is None else self._begun[0]

    first = property(lambda self: self.skipped, doc="Place of the first row that is reached.")

    @property
    def needed_ease(self) -> int | None:
        """Iterations that the limits need for its take-over, at most 4095; 0 if `ease` is enough.

        With fewer iterations, the actuators overshoot its first rows and return.
        """
        return None if self._begun is None else self._begun[1]

    @property
    def begins(self) -> int | None:
        """The first iteration in which it moves the actuators."""
        return None if self._decided is None else self._decided.begins

    @property
    def shift(self) -> int | None:
        """Iterations by which its rows are later, because the actuators were at rest."""
        return None if self._decided is None else self._decided.shift

    def wait(self, timeout: float | None = None) -> None:
        """Waits until the chunk has ended, as `Batch.wait` with check=False."""
        self.batch.wait(timeout, check=False)

    @property
    def _decided(self) -> Decision | None:
        if self._decision is None:
            shift = self.batch._shift
            if shift is not None:
                self._decision = decide(self._sent, self.batch.first_iteration, *shift)
        return self._decision

    @property
    def _begun(self) -> tuple[int, int] | None:
        if self._take_over is None:
            self._take_over = self.batch._take_over
        return self._take_over


class ChunkPart:
    """The plan of one chunk, from its begin on.

    `start`: place and derivatives in the iteration before it, from which its places are computed on
    demand. `known` is false as long as `start` is only an expectation.
    """

    def __init__(self, sent: SentChunk, way: ChunkWay) -> None:
        self.sent = sent
        self.begins = way.begins
        self.last = way.last
        self.known = False
        self.start: Moment | None = None
        self._way = way
        self._computed: Moment | None = None
        self._row: int | None = None  # first row that is reached, if the loop has reported it

    def begin(self, start: Moment, known: bool = True) -> None:
        """Sets place and derivatives in the iteration before it."""
        self.start, self.known, self._computed = start, known, None
        begun = self.sent._begun if known else None
        self._row = None if begun is None else begun[0]

    def at(self, iteration: int, *, alone: bool = False) -> Moment:
        """Returns places and derivatives (actuators,) from its begin on; after its end it rests.

        alone: no later iterations will be requested.
        """
        place = iteration - self.begins
        most = self.last - self.begins + 1
        if place >= most:
            rests = np.zeros_like(self._way.rows[-1])
            return self._way.rows[-1], rests, rests
        if self._computed is None or len(self._computed[0]) <= place:
            assert self.start is not None
            # a chunk may be planned for hours: compute little more than requested
            wanted = place + 1 if alone else min(most, max(1024, 2 * place))
            self._computed = self._way.places(self.start, wanted, self._row)
        places, slopes, curvatures = self._computed  # (iterations, actuators)
        return places[place], slopes[place], curvatures[place]

    def acts(self, iteration: int) -> bool:
        """True if a motion in the iteration after this one continues this plan."""
        batch = self.sent.batch
        # dropped commands do not act in the iteration in which they end, and braking is no plan
        behind = {Status.COMPLETED: 0, Status.OVERWRITTEN: 1}.get(batch[0].status, 2)
        return not batch.ended or batch.last_iteration >= iteration + behind

    def note_end(self) -> None:
        """Ends the plan of a dropped chunk in the iteration in which it was dropped."""
        batch = self.sent.batch
        kept = (Status.COMPLETED, Status.FORGOTTEN)
        if batch.ended and batch[0].status not in kept and batch.last_iteration <= self.last:
            self.end_in(batch.last_iteration)

    def is_over(self, iteration: int) -> bool:
        """True if it has ended before this iteration, and its plan is final."""
        return self.known and self.last < iteration and self.sent.batch.ended

    def end_in(self, iteration: int) -> None:
        """Removes this iteration and later ones from the plan."""
        self.last = min(self.last, iteration - 1)
        kept = max(0, iteration - self.begins)
        if self._computed is not None and len(self._computed[0]) > kept:
            places, slopes, curvatures = self._computed
            self._computed = places[:kept].copy(), slopes[:kept].copy(), curvatures[:kept].copy()
