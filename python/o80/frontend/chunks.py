"""Chunks: rows of targets, each for a fixed iteration, of a policy that answers late."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.awaiting import in_thread
from o80.base.errors import InvalidArgument
from o80.base.words import RowsWord, Status
from o80.rows.targets import common_type, states_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from o80.frontend.commander import Commander

#: Time of a take-over, if a step is not longer [s].
EASE = 0.1

_plans = itertools.count(1)


class SentChunk:
    """A chunk that was sent. `late`, `skipped`, `first`, `begins` and `shift` are None until it
    was decided in the loop, and if it was rejected.
    """

    def __init__(self, batch: _core.Batch, sent: _Sent) -> None:
        self.batch = batch  #: with this chunk as its only command
        self._sent = sent
        self._decision: _Decision | None = None

    @property
    def decided(self) -> bool:
        """Whether the backend has taken or rejected it."""
        return self.batch.taken

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
        return None if self._decided is None else self._decided.row

    first = property(lambda self: self.skipped, doc="Place of the first row that is reached.")

    @property
    def begins(self) -> int | None:
        """The first iteration that it moves."""
        return None if self._decided is None else self._decided.begins

    @property
    def shift(self) -> int | None:
        """By how many iterations its rows are later, because the actuators stood still."""
        return None if self._decided is None else self._decided.shift

    def wait(self, timeout: float | None = None) -> None:
        """Waits until the chunk has ended, as `Batch.wait` with check=False."""
        self.batch.wait(timeout, check=False)

    @property
    def _decided(self) -> _Decision | None:
        if self._decision is None and self.decided:
            shift = self.batch._shift
            if shift is not None and not self.rejected:
                self._decision = _decide(self._sent, self.batch.first_iteration, *shift)
        return self._decision


@dataclass(frozen=True)
class _Sent:
    anchor: int
    due: NDArray[np.int64]  # iterations after the anchor
    ease: int
    first: int
    rows: NDArray[np.float64]  # (rows, actuators)


@dataclass(frozen=True)
class _Decision:
    shift: int
    begins: int
    late: int
    row: int  # the first that is reached
    stood: bool


def _decide(sent: _Sent, taken: int, shift: int, stood: bool) -> _Decision:
    """As the loop decides (src/control/batch/chunk.cpp), from what its status tells."""
    anchor = sent.anchor + shift
    first = 0 if stood else sent.first
    begins = max(taken, anchor + (int(sent.due[first - 1]) if first else 0) + 1)
    late = int(np.searchsorted(sent.due, taken - anchor))
    row = int(np.searchsorted(sent.due, begins + sent.ease - 1 - anchor))
    return _Decision(shift, begins, late, min(row, len(sent.due) - 1), stood)


@dataclass(frozen=True)
class _Part:
    """The plan of one chunk, from its begin on."""

    begins: int
    places: NDArray[np.float64]  # (iterations, actuators)
    slopes: NDArray[np.float64]
    sent: SentChunk

    @property
    def last(self) -> int:
        return self.begins + len(self.places) - 1

    def at(self, iteration: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places and slopes; after its end it rests."""
        if iteration > self.last:
            return self.places[-1], np.zeros_like(self.places[-1])
        return self.places[iteration - self.begins], self.slopes[iteration - self.begins]


class ChunkWaits:
    """The wait of a plan as a coroutine, as those of `Frontend.aio`."""

    def __init__(self, plan: Chunks) -> None:
        self._plan = plan

    async def wait(
        self, lead: int = 0, timeout: float | None = None, *, grid: bool = False
    ) -> _core.Observation:
        """Waits as `Chunks.wait`."""
        return await in_thread(lambda: self._plan.wait(lead, timeout, grid=grid))


class Chunks:
    """The plan of a policy that answers with rows of targets, late, while the robot moves.

    See docs/chunks.md. Made by `Frontend.chunks`. Use it as a context manager.
    """

    def __init__(
        self,
        arm: Commander,
        actuators: int | str | Sequence[int | str] | None,
        *,
        step: float | Fraction,
        ease: int | None = None,
        profile: RowsWord = "cubic",
        ensemble: float | None = None,
    ) -> None:
        arm.latest()  # raises what a frontend that cannot be used raises
        self._arm = arm
        self._actuators, self._single = arm._chosen(actuators)
        self._kind = common_type(self._actuators, arm._layout)
        self.step = Fraction(step).limit_denominator(10**6)  #: iterations from row to row
        if self.step < 1:
            raise InvalidArgument(f"step must be at least 1 iteration, got {step}")
        usual = max(math.ceil(self.step), round(EASE / arm.period))
        self.ease = usual if ease is None else whole(ease, "ease")  #: iterations of a take-over
        self.profile = profile
        self.ensemble = ensemble
        self._number = next(_plans)
        self._closed = False
        self._sent: list[SentChunk] = []
        self._parts: list[_Part] = []
        self._settled = 0  # of the chunks sent, those that _parts knows
        self._answers: dict[int, int] = {}  # for a due iteration, how many chunks had a row for it

    # ------------------------------------------------------------------ sending

    def send(
        self,
        rows: ArrayLike,
        *,
        seen: _core.Observation | int | None = None,
        first: int = 0,
        fixed: bool = False,
        late: Literal["skip", "reject"] = "skip",
        due: Sequence[int] | None = None,
        weights: ArrayLike | None = None,
    ) -> SentChunk:
        """Sends rows of targets; row j is due in iteration seen + (j + 1) x step, rounded.

        rows: (n, actuators), or (n,) for a single actuator, as in add_trajectory.
        seen: the observation that the policy saw, or its iteration (None: the newest).
        first: number of rows at the begin that are what was planned before; they are not played,
            and an answer that comes before the last of them is over gives the same motion however
            late it is.
        fixed: rows keep their iterations also where the actuators have stood still.
        late: rows that are due before the chunk is taken are skipped ("skip"); or, if row `first`
            is among them, the whole chunk is rejected ("reject").
        due: an own iteration for each row, rising, instead of the steps.
        weights: the share of each row (n,); the rest is the plan in its iteration, where there is
            one.

        It replaces what its actuators do, from the plan of the chunk before it without a jump. If
        they stood still, rows are later by the time in which they did. Raises InvalidArgument,
        and the exceptions of pulse.
        """
        if self._closed:
            raise InvalidArgument("this plan was closed: open another one with chunks()")
        if late not in ("skip", "reject"):
            raise InvalidArgument(f"late must be 'skip' or 'reject', got {late!r}")
        anchor = self._anchor(seen)
        mixed = weights is not None or self.ensemble is not None
        if mixed:
            rows = self._numbers(rows)
            after = self._after(len(rows), anchor, due)
            rows = self._mixed(rows, anchor + after, weights)
        states, count, mask = states_of(rows, self._actuators, self._single, self._arm._layout)
        if not mixed:
            after = self._after(count, anchor, due)
        ease = 1 if self.profile == "hold" else self.ease
        batch = self._arm._send_chunk(
            self._actuators,
            after.astype(np.uint32).view(np.uint8),
            states,
            mask,
            anchor,
            self._number,
            ease,
            whole(first, "first"),
            bool(fixed),
            late == "reject",
            self.profile,
            seen if isinstance(seen, _core.Observation) else None,
        )
        numbers = self._numbers(rows) if self._is_plain else np.empty((count, 0))
        self._sent.append(SentChunk(batch, _Sent(anchor, after, ease, first, numbers)))
        return self._sent[-1]

    def _anchor(self, seen: _core.Observation | int | None) -> int:
        if seen is None:
            return self._arm.published
        return whole(seen.iteration if isinstance(seen, _core.Observation) else seen, "seen")

    def _after(self, count: int, anchor: int, due: Sequence[int] | None) -> NDArray[np.int64]:
        """When rows are due, in iterations after the anchor. Raises InvalidArgument."""
        if count == 0:
            raise InvalidArgument("a chunk needs a row")
        if due is None:
            return self._due(count)
        after = np.asarray(due, np.int64) - anchor
        if len(after) != count:
            raise InvalidArgument(f"{count} rows need as many due iterations, got {len(after)}")
        if not (after[0] >= 1 and np.all(np.diff(after) > 0) and after[-1] <= 2**31):
            raise InvalidArgument(
                f"rows are due one after the other, after iteration {anchor}, which they answer, "
                f"and at most 2^31 iterations later: got {(after + anchor).tolist()}"
            )
        return after

    def _due(self, count: int) -> NDArray[np.int64]:
        """Iterations after the anchor: (j + 1) x step, halves up."""
        up, down = self.step.numerator, self.step.denominator
        return (np.arange(1, count + 1, dtype=np.int64) * (2 * up) + down) // (2 * down)

    def _mixed(
        self, new: NDArray[np.float64], due: NDArray[np.int64], weights: ArrayLike | None
    ) -> NDArray[np.float64]:
        shares = np.ones(len(new)) if weights is None else np.asarray(weights, float)
        if shares.shape != (len(new),):
            raise InvalidArgument(f"weights are ({len(new)},), not {shares.shape}")
        for row, iteration in enumerate(due.tolist()):
            plan = self._plan_at(iteration)
            answers = self._answers.get(iteration, 0) if plan is not None else 0
            self._answers[iteration] = answers + 1
            if plan is None:
                continue
            share = shares[row]
            if self.ensemble is not None:
                all_of_them = np.exp(-self.ensemble * np.arange(answers + 1))
                share = all_of_them[-1] / all_of_them.sum()
            new[row] = plan + (new[row] - plan) * share
        past = self._arm.published
        self._answers = {key: value for key, value in self._answers.items() if key > past}
        return new[:, 0] if self._single else new

    # ------------------------------------------------------------------ the plan

    @property
    def left(self) -> int:
        """Iterations from the newest row to the last row of the plan; 0 if there is none."""
        self._settle()
        return max(0, self._last - self._arm.published) if self._parts else 0

    @property
    def starved(self) -> bool:
        """Whether the plan is open, was begun, and has no row ahead."""
        return not self._closed and bool(self._sent) and self._undecided is None and self.left == 0

    def planned(
        self,
        since: int | _core.Observation,
        n: int | None = None,
        *,
        step: float | Fraction | None = None,
    ) -> NDArray[np.float64]:
        """Planned places for the iterations since + step, since + 2 steps, ...: at most n rows.

        since: an iteration or an observation, such as the one that a policy sees.
        step: iterations from row to row (None: that of the plan; 1: every iteration).

        Returns (rows, actuators), or (rows,) for a single actuator: in a policy's prefix the
        targets that are played whatever it answers. It counts the chunks that were decided, and
        holds if nobody else commands.
        """
        anchor = self._anchor(since)
        own = self if step is None else Chunks(self._arm, self._actuators, step=step)
        places: list[NDArray[np.float64]] = []
        for count in itertools.count(1):
            place = self._plan_at(anchor + int(own._due(count)[-1]))
            if place is None or (n is not None and len(places) == n):
                break
            places.append(place)
        planned = np.array(places).reshape(len(places), len(self._actuators))
        return planned[:, 0] if self._single else planned

    def wait(
        self, lead: int = 0, timeout: float | None = None, *, grid: bool = False
    ) -> _core.Observation:
        """Waits until the chunk sent last was decided and at most `lead` iterations are planned.

        Returns the newest observation, or, with `grid`, the newest that lies whole steps after the
        one that the last chunk answers. A bursting backend runs until then.

        timeout: how long to wait [s]. Raises TimeoutError, BackendGone, BackendHalted.
        """
        arm = self._arm
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            waits = self._undecided is not None
            ahead = max(1, 0 if waits else self.left - lead)
            if not waits and self.left <= lead:
                break
            patience = None if end is None else max(0.0, end - time.monotonic())
            if arm.bursting:
                arm.burst(1 if waits else ahead, timeout=patience)
            else:
                arm.keep_alive()
                arm.wait_for(arm.published + min(ahead, 10), patience)
        if not grid or not self._sent:
            return arm.latest()
        anchor = self._sent[-1]._sent.anchor
        steps = int((arm.published - anchor) / self.step)
        behind = int(self._due(steps)[-1]) if steps > 0 else 0
        return arm.wait_for(anchor + behind)

    @property
    def aio(self) -> ChunkWaits:
        """The same wait for asyncio: `seen = await plan.aio.wait(lead=120)`."""
        return ChunkWaits(self)

    @property
    def _undecided(self) -> SentChunk | None:
        return next((sent for sent in self._sent[self._settled :] if not sent.decided), None)

    @property
    def _last(self) -> int:
        return self._parts[-1].last

    @property
    def _is_plain(self) -> bool:
        return self._kind.names is None and self._kind.shape == ()

    def _numbers(self, rows: ArrayLike) -> NDArray[np.float64]:
        if not self._is_plain:
            raise InvalidArgument(
                "planned, weights and ensemble are for actuators whose state is one number"
            )
        numbers = np.array(rows, np.float64)
        return numbers[:, np.newaxis] if numbers.ndim == 1 else numbers

    def _plan_at(self, iteration: int) -> NDArray[np.float64] | None:
        """Places in an iteration; None if nothing is planned for it."""
        if not self._is_plain:
            self._numbers(())
        self._settle()
        for part in reversed(self._parts):
            if part.begins <= iteration:
                return part.places[iteration - part.begins] if iteration <= part.last else None
        return None

    def _settle(self) -> None:
        """Adds the plans of chunks that were decided meanwhile, in their order."""
        while self._settled < len(self._sent):
            sent = self._sent[self._settled]
            if not sent.decided:
                return
            decision = sent._decided
            if decision is not None and not self._add(sent, decision):
                return
            self._settled += 1
        # of what is over, the history has the rows
        while len(self._parts) > 1 and self._parts[1].begins <= self._arm.oldest:
            del self._parts[0]

    def _add(self, sent: SentChunk, decision: _Decision) -> bool:
        """False if the row before it is needed, and is not there yet."""
        before = decision.begins - 1
        # those that wait for the same or a later iteration are overwritten
        parts = [part for part in self._parts if part.begins < decision.begins]
        chunk = sent._sent
        if parts and before <= parts[-1].last:
            place, slope = parts[-1].at(before)
        elif before > self._arm.published:
            return False
        else:
            place, slope = self._motion(before, decision.stood)
        ends = chunk.due + chunk.anchor + decision.shift - before
        ends = ends[decision.row :]
        ends[0] = max(int(ends[0]), 1 if self.profile == "hold" else chunk.ease)
        rows = chunk.rows[decision.row :]
        plans = [
            _core.plan_of_rows(
                float(place[i]), float(slope[i]), rows[:, i].tolist(), ends.tolist(), self.profile
            )
            for i in range(rows.shape[1])
        ]
        count = int(ends[-1])
        places = np.array([each[0] for each in plans]).reshape(len(plans), count).T
        slopes = np.array([each[1] for each in plans]).reshape(len(plans), count).T
        self._parts = [*parts, _Part(decision.begins, places, slopes, sent)]
        return True

    def _motion(self, row: int, stood: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Desired places and differences of a row, from the history."""
        if not self._is_plain:
            return np.empty(0), np.empty(0)

        def desired(iteration: int) -> NDArray[np.float64]:
            all_of_them = self._arm.wait_for(iteration).desired
            return np.array([all_of_them[actuator] for actuator in self._actuators], np.float64)

        here = desired(row)
        return here, np.zeros_like(here) if stood or row == 0 else here - desired(row - 1)

    # ------------------------------------------------------------------ its end

    def close(self) -> None:
        """Ends the plan: what was sent is played to its last row. May be called twice."""
        self._closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
