"""Chunks that were sent, and the plan of each."""

import numpy as np

import o80._core as _core
from o80.base.words import Status
from o80.rows.plans import ChunkRows, ChunkWay, Decision, Moment, decide


class SentChunk:
    """A chunk that was sent. `late`, `begins` and `shift` are None until it was decided in the
    loop, `skipped`, `first` and `needed_ease` until it has begun, and all if it was rejected.
    """

    def __init__(self, batch: _core.Batch, sent: ChunkRows) -> None:
        self.batch = batch  #: with this chunk as its only command
        self._sent = sent
        self._decision: Decision | None = None
        self._take_over: tuple[int, int] | None = None  # first row, iterations needed

    @property
    def clipped(self) -> int:
        """Numbers of its rows that `clip` has put inside their bounds."""
        return self.batch.clipped

    @property
    def decided(self) -> bool:
        """Whether the backend has taken or rejected it."""
        return self.batch._shift is not None or self.batch.ended

    @property
    def rejected(self) -> bool:
        """Whether it was rejected: `batch[0]` says why."""
        return self.batch[0].status == Status.REJECTED

    @property
    def late(self) -> int | None:
        """Number of rows that were due before it was taken: they are skipped."""
        return None if self._decided is None else self._decided.late

    @property
    def skipped(self) -> int | None:
        """Number of rows that are not reached: late ones, and those that the take-over passes."""
        return None if self._begun is None else self._begun[0]

    first = property(lambda self: self.skipped, doc="Place of the first row that is reached.")

    @property
    def needed_ease(self) -> int | None:
        """Iterations that the limits need for its take-over, at most 4095; 0 if it has them.

        With fewer, the actuators pass its first rows and come back.
        """
        return None if self._begun is None else self._begun[1]

    @property
    def begins(self) -> int | None:
        """The first iteration that it moves."""
        return None if self._decided is None else self._decided.begins

    @property
    def shift(self) -> int | None:
        """By how many iterations its rows are later, because the actuators were at rest."""
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

    `known`: place and derivatives of the iteration before it, from which its places are computed
    when somebody asks for them. Until that row is there, `start` may be what is expected.
    """

    def __init__(self, sent: SentChunk, way: ChunkWay) -> None:
        self.sent = sent
        self.begins = way.begins
        self.last = way.last
        self.known = False
        self.start: Moment | None = None
        self._way = way
        self._computed: Moment | None = None
        self._row: int | None = None  # the first that is reached, if the loop has reported it

    def begin(self, start: Moment, known: bool = True) -> None:
        """From place and derivatives in the iteration before it."""
        self.start, self.known, self._computed = start, known, None
        begun = self.sent._begun if known else None
        self._row = None if begun is None else begun[0]

    def at(self, iteration: int, *, alone: bool = False) -> Moment:
        """Places and derivatives (actuators,) from its begin on; after its end it rests.

        alone: nobody will ask for later ones.
        """
        place = iteration - self.begins
        most = self.last - self.begins + 1
        if place >= most:
            rests = np.zeros_like(self._way.rows[-1])
            return self._way.rows[-1], rests, rests
        if self._computed is None or len(self._computed[0]) <= place:
            assert self.start is not None
            # a chunk may be planned for hours: not further than about what is asked for
            wanted = place + 1 if alone else min(most, max(1024, 2 * place))
            self._computed = self._way.places(self.start, wanted, self._row)
        places, slopes, curvatures = self._computed  # (iterations, actuators)
        return places[place], slopes[place], curvatures[place]

    def acts(self, iteration: int) -> bool:
        """Whether a motion in the iteration after this one continues this plan."""
        batch = self.sent.batch
        # dropped commands act no more in the iteration in which they end, and braking is no plan
        behind = {Status.COMPLETED: 0, Status.OVERWRITTEN: 1}.get(batch[0].status, 2)
        return not batch.ended or batch.last_iteration >= iteration + behind

    def note_end(self) -> None:
        """If it was dropped: nothing of it is planned from there on."""
        batch = self.sent.batch
        kept = (Status.COMPLETED, Status.FORGOTTEN)
        if batch.ended and batch[0].status not in kept and batch.last_iteration <= self.last:
            self.end_in(batch.last_iteration)

    def is_over(self, iteration: int) -> bool:
        """Whether it has ended before this iteration, and nothing changes any more."""
        return self.known and self.last < iteration and self.sent.batch.ended

    def end_in(self, iteration: int) -> None:
        """Nothing of it is planned in this iteration and later."""
        self.last = min(self.last, iteration - 1)
        kept = max(0, iteration - self.begins)
        if self._computed is not None and len(self._computed[0]) > kept:
            places, slopes, curvatures = self._computed
            self._computed = places[:kept].copy(), slopes[:kept].copy(), curvatures[:kept].copy()
