"""Chunks: rows of targets, each for a fixed iteration, of a policy that answers late."""

import contextlib
import itertools
import math
import os
import threading
import time
from collections.abc import Sequence, Sized
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

import o80._core as _core
from o80.base.argument_checks import iterations, number, text, whole, whole_or_none
from o80.base.awaiting import in_thread
from o80.base.errors import BackendGone, BackendHalted, Closed, InvalidArgument, RowOverwritten
from o80.base.lifecycle import Managed
from o80.base.words import RowsWord
from o80.frontend.chunk_parts import ChunkPart, SentChunk
from o80.rows.given_numbers import GivenNumbers
from o80.rows.plans import ChunkRows, ChunkWay, Moment
from o80.rows.targets import Rows, first_fields, states_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from o80.frontend.commander import Commander

#: place, slope and curvature
Start = tuple[float, float, float]

#: Time of a take-over where no number has a limit of acceleration, if a step is not longer [s].
EASE = 0.1

_LATEST = 2**31  # largest distance of a row's due iteration from the anchor
_MOST_ITERATIONS = 2**47
# number of sent chunks, and of passed iterations, after which send() updates the plan by itself,
# if nothing reads the plan
_UNSETTLED, _UNSEEN = 16, 1000
_ENTRIES = 1000  # entries of the journal that are read at once


def _from_to(value: Any, name: str, low: int, high: int) -> int:
    if low <= whole(value, name) <= high:
        return int(value)
    raise InvalidArgument(f"{name} must be from {low} to {high}, got {value}")


def _fraction(step: Any) -> Fraction:
    try:
        exact = step if isinstance(step, Fraction) else Fraction(number(step, "step"))
    except (ValueError, OverflowError):
        raise InvalidArgument(f"step must be a number, got {step!r}") from None
    fraction = exact.limit_denominator(10**6)
    if fraction < 1:
        raise InvalidArgument(f"step must be at least 1 iteration, got {step}")
    if fraction > _LATEST:
        raise InvalidArgument(f"step must be at most 2^31 iterations, got {step}")
    return fraction


def _due_after(step: Fraction, rows: Any) -> Any:
    """Converts rows to iterations after the anchor, halves up."""
    return (rows * (2 * step.numerator) + step.denominator) // (2 * step.denominator)


def _iterations(values: "ArrayLike", name: str) -> "NDArray[np.int64]":
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise InvalidArgument(f"{name} must be a list of whole numbers, got {values!r}")
    return array.astype(np.int64)


def _finite(values: "ArrayLike", name: str) -> "NDArray[np.float64]":
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if np.all(np.isfinite(array)):
        return array
    raise InvalidArgument(f"{name} must be finite numbers, got {values!r}")


class ChunkWaits:
    """The waiting method of a plan as a coroutine, like those of `Frontend.aio`."""

    def __init__(self, plan: "Chunks") -> None:
        self._plan = plan

    async def wait(
        self, lead: float = 0, timeout: float | None = None, *, grid: bool = False
    ) -> _core.Observation:
        """Waits like `Chunks.wait`."""
        return await in_thread(lambda: self._plan.wait(lead, timeout, grid=grid))


class Chunks(Managed):
    """The plan of a policy that returns rows of targets, late, while the robot moves.

    See docs/chunks.md. Made by `Frontend.chunks`. Use it as a context manager.
    """

    def __init__(
        self,
        arm: "Commander",
        actuators: int | str | Sequence[int | str] | None,
        *,
        step: float | Fraction,
        ease: float | None = None,
        profile: RowsWord = "smooth",
        ensemble: float | None = None,
        clip: bool = False,
    ) -> None:
        arm.latest()  # raises the error of a frontend that cannot be used
        self._arm = arm
        self._actuators, self._single = arm._chosen(actuators)
        self._masks = first_fields(self._actuators, arm._layout)
        self._given = GivenNumbers(self._actuators, self._masks, arm._layout)
        self.clip = clip  #: whether numbers outside minimum and maximum are moved to them
        self.step = _fraction(step)  #: iterations from row to row
        self._dues = np.empty(0, np.int64)
        self.ease = 0  #: iterations of a take-over; 0: as many as the limits need
        if not any(math.isfinite(each.rates[1]) for each in self._given.limits):
            self.ease = max(math.ceil(self.step), round(EASE / arm.period))
        if ease is not None:
            self.ease = _from_to(iterations(ease, "ease", arm.period, 0), "ease", 1, _LATEST)
        # it says what a profile may be
        _core.plan_of_rows((0.0, 0.0, 0.0), [0.0], [1], text(profile, "profile"), 1, 0.0, 0.0)
        self.profile = profile
        self.ensemble = ensemble if ensemble is None else number(ensemble, "ensemble")
        if self.ensemble is not None and not math.isfinite(self.ensemble):
            raise InvalidArgument(f"ensemble must be a finite number, got {ensemble}")
        # a unique number, also among plans of former processes on the same lane
        self._number = int.from_bytes(os.urandom(8))
        self._closed = False
        self._lock = threading.RLock()
        self._newest: SentChunk | None = None  # the last sent chunk
        self._seen = -1  # the last row that `wait` returned
        self._open: list[SentChunk] = []  # chunks that are not in _parts yet
        self._settled = 0  # the anchor at which send() updated the plan last
        self._parts: list[ChunkPart] = []
        self._over = 0  # number of parts that are over, from the first one on
        self._journal = _core.Journal(arm)
        self._journal.seek_end()
        self._starts: dict[int, dict[tuple[int, int], Start]] = {}  # of an iteration, by number
        self._answers: dict[int, int] = {}  # number of chunks with a row for a due iteration

    # ------------------------------------------------------------------ sending

    def send(
        self,
        rows: Rows,
        *,
        seen: _core.Observation | int | None = None,
        first: int = 0,
        fixed: bool = False,
        late: Literal["skip", "reject"] = "skip",
        due: Sequence[int] | None = None,
        weights: "ArrayLike | None" = None,
        final: bool = False,
    ) -> SentChunk:
        """Sends rows of targets; row j is due in iteration seen + (j + 1) x step, rounded.

        rows: (n, actuators), or (n,) for a single actuator: the first field of each; or a mapping
            from fields, groups, actuators or paths to such arrays, as in add_trajectory.
        seen: the observation that the policy saw, or its iteration (None: the newest). For an
            observation of another segment on the same clock, the newest row before its capture.
        first: number of rows at the begin that repeat the former plan; they are not played, and an
            answer that arrives before the last of them is over gives the same motion at any delay.
        fixed: rows keep their iterations also if the actuators have stood still.
        late: rows that are due before the chunk is taken are skipped ("skip"); or, if row `first`
            is among them, the whole chunk is rejected ("reject").
        due: an own iteration for each row, rising, instead of the steps.
        weights: the share of each row (n,); the rest is the share of the plan in its iteration, if
            there is one.
        final: no chunk follows, so that the plan is not starved when its rows end.

        The chunk replaces the motion of its actuators, and continues the plan of the previous
        chunk without a jump. If they stood still, rows are later by the time of the standstill.
        Raises InvalidArgument, and the exceptions of pulse.
        """
        if self._closed:
            raise InvalidArgument("this plan was closed: open another one with chunks()")
        if late not in ("skip", "reject"):
            raise InvalidArgument(f"late must be 'skip' or 'reject', got {late!r}")
        anchor = self._anchor(seen)
        if isinstance(rows, Sized) and len(rows) == 0:
            raise InvalidArgument("a chunk needs a row")
        states, count, masks = states_of(rows, self._actuators, self._arm._layout)
        first = _from_to(first, "first", 0, count - 1)
        after = self._due(count) if due is None else _iterations(due, "due") - anchor
        if due is not None or after[-1] > _LATEST:
            self._check_due(after, count, anchor)
        with self._lock:  # chunks of several threads are stored in the order of sending
            clipped = 0
            if self.clip:
                inside, clipped = self._arm._clip(self._actuators, count, states, masks)
                states = np.frombuffer(inside, np.uint8)
            self._note_given(masks)
            numbers = self._given.values(states, count)
            if weights is not None or self.ensemble is not None:
                states = states.copy()
                self._given.put(self._mixed(numbers, anchor + after, weights), states)
                numbers = self._given.values(states, count)
            ease = 1 if self.profile == "hold" else self.ease
            batch = self._arm._send_chunk(
                self._actuators,
                after.astype(np.uint32),
                states,
                masks,
                anchor,
                self._number,
                ease,
                first,
                bool(fixed),
                late == "reject",
                bool(final),
                self.profile,
                seen if isinstance(seen, _core.Observation) else None,
                clipped,
            )
            if self.ensemble is not None:
                self._count_answers(anchor + after)
            sent = SentChunk(batch, ChunkRows(anchor, after, ease, first, numbers))
            self._arm._open_plans.add(self._number)
            self._open.append(sent)
            self._newest = sent
            if len(self._open) > _UNSETTLED or anchor - self._settled > _UNSEEN:
                self._settled = anchor
                self._settle()
        return sent

    def _anchor(self, seen: _core.Observation | int | None) -> int:
        if seen is None:
            return self._arm.published
        if not isinstance(seen, _core.Observation):
            return _from_to(seen, "seen", -_LATEST, _MOST_ITERATIONS)
        since: int = self._arm._since(seen)
        if since < 0:
            raise InvalidArgument(
                f"row {seen.iteration} is from another run, and '{self._arm.segment}' has no row "
                "from before its capture: give a row of this robot, or of one with the same clock"
            )
        return since

    def _note_given(self, masks: list[int]) -> None:
        """Selects the numbers that chunks give; the plan of other numbers is unknown."""
        if masks == self._masks:
            return
        self._masks = masks
        self._given = GivenNumbers(self._actuators, masks, self._arm._layout)
        self._parts, self._open, self._over = [], [], 0

    def _due(self, count: int) -> "NDArray[np.int64]":
        """Returns iterations after the anchor: (j + 1) x step, halves up."""
        dues = self._dues  # another thread may send a chunk of another length
        if len(dues) != count:
            dues = self._dues = _due_after(self.step, np.arange(1, count + 1, dtype=np.int64))
        return dues

    def _check_due(self, after: "NDArray[np.int64]", count: int, anchor: int) -> None:
        if len(after) != count:
            raise InvalidArgument(f"{count} rows need {count} due iterations, got {len(after)}")
        if not (after[0] >= 1 and np.all(np.diff(after) > 0) and after[-1] <= _LATEST):
            raise InvalidArgument(
                f"due iterations must rise, from after iteration {anchor}, which the rows answer, "
                f"to at most 2^31 iterations later: got {(after + anchor).tolist()}"
            )

    def _mixed(
        self, new: "NDArray[np.float64]", due: "NDArray[np.int64]", weights: "ArrayLike | None"
    ) -> "NDArray[np.float64]":
        shares = np.ones(len(new)) if weights is None else _finite(weights, "weights")
        if shares.shape != (len(new),):
            raise InvalidArgument(f"weights must have the shape ({len(new)},), got {shares.shape}")
        if shares.min() < 0 or shares.max() > 1:
            raise InvalidArgument(f"weights must be from 0 to 1, got {shares.tolist()}")
        self._settle()
        for row, iteration in enumerate(due.tolist()):
            plan = self._plan_at(iteration)
            if plan is None:
                continue
            share = shares[row]
            if self.ensemble is not None:
                answers = self._answers.get(iteration, 0)
                all_of_them = np.exp(-self.ensemble * np.arange(answers + 1))
                share = all_of_them[-1] / all_of_them.sum()
            moves = ~np.array(self._given.switches)
            new[row, moves] = (plan + (new[row] - plan) * share)[moves]
        return new

    def _count_answers(self, due: "NDArray[np.int64]") -> None:
        for iteration in due.tolist():
            planned = self._plan_at(iteration) is not None
            self._answers[iteration] = (self._answers.get(iteration, 0) if planned else 0) + 1
        past = self._arm.published
        self._answers = {key: value for key, value in self._answers.items() if key > past}

    # ------------------------------------------------------------------ the plan

    @property
    def left(self) -> int:
        """Iterations from the newest row to the last row of the plan; 0 without a plan."""
        self._settle()
        parts = self._parts
        return max(0, parts[-1].last - self._arm.published) if parts else 0

    @property
    def starved(self) -> bool:
        """Whether the plan is open, and has no row left in the newest row."""
        if self._closed or self._newest is None:
            return False
        return bool(self._arm.latest().starved[self._actuators].any())

    def planned(
        self,
        since: int | _core.Observation,
        n: int | None = None,
        *,
        step: float | Fraction | None = None,
    ) -> "NDArray[np.float64]":
        """Returns planned places for iterations since + step, since + 2 steps, ...: at most n rows.

        since: an iteration or an observation, such as the one that a policy sees.
        step: iterations from row to row (None: that of the plan; 1: every iteration).

        Returns (rows, numbers), with the numbers that the chunks give, or (rows,) for a single
        number: in a policy's prefix the targets that are played for any answer. The result
        includes chunks that were decided, and holds if nobody else commands.
        """
        anchor = self._anchor(since)
        n = whole_or_none(n, "n", 0)
        self._settle()
        every = self.step if step is None else _fraction(step)
        places: list[NDArray[np.float64]] = []
        for count in itertools.count(1):
            place = self._plan_at(anchor + _due_after(every, count))
            if place is None or (n is not None and len(places) == n):
                break
            places.append(place)
        planned = np.array(places).reshape(len(places), len(self._given.places))
        return planned[:, 0] if self._single and planned.shape[1] == 1 else planned

    @property
    def aio(self) -> ChunkWaits:
        """The waiting method for asyncio: `seen = await plan.aio.wait(lead=120)`."""
        return ChunkWaits(self)

    def wait(
        self, lead: float = 0, timeout: float | None = None, *, grid: bool = False
    ) -> _core.Observation:
        """Waits until the backend has decided on the last chunk and at most `lead` of plan is left.

        Returns the newest observation; with `grid`, the newest one that is a whole number of steps
        after the observation of the last chunk. In real time, each call returns another one. A
        bursting backend runs until then.

        lead: iterations, or as a float the time [s]. timeout: longest wait [s]. Raises
        TimeoutError, BackendGone, BackendHalted.
        """
        arm = self._arm
        lead = iterations(lead, "lead", arm.period, 0)
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            if (halt := arm.halted) is not None and halt.iteration is not None:  # it is in force
                why = f" ({halt.text})" if halt.text else ""
                raise BackendHalted(f"'{arm.segment}' is halted{why}: `resume` it, then send again")
            if not arm.bursting:
                arm.keep_alive()
            newest = self._newest
            waits = newest is not None and not newest.decided
            ahead = max(1, 0 if waits else self.left - lead)
            if not waits and self.left <= lead and (arm.bursting or arm.published != self._seen):
                break
            patience = None if end is None else max(0.0, end - time.monotonic())
            if arm.bursting:
                arm.burst(1 if waits else ahead, timeout=patience)
            else:
                arm.wait_for(arm.published + min(ahead, 10), patience)
        row = arm.latest()
        self._seen = row.iteration
        if not grid or newest is None:
            return row
        anchor = newest._sent.anchor
        steps = int((arm.published - anchor) / self.step)
        return arm.wait_for(anchor + _due_after(self.step, max(0, steps)))

    def _plan_at(self, iteration: int) -> "NDArray[np.float64] | None":
        """Returns places in an iteration; None if it is not planned, or its plan not known yet."""
        with self._lock:
            i = len(self._parts) - 1
            while i >= 0 and self._parts[i].begins > iteration:
                i -= 1
            if i < 0 or iteration > self._parts[i].last:
                return None
            part = self._parts[i]
            if part.start is not None:
                return part.at(iteration)[0]
            # the start of its motion is no longer available, or not yet
            while i > 0 and self._parts[i - 1].acts(self._parts[i].begins - 1):
                i -= 1
            if self._parts[i].sent._begun is not None:
                self._start_of(self._parts[i])
            return None

    def _settle(self) -> None:
        """Adds the plans of chunks that were decided meanwhile, in order."""
        with self._lock:
            parts = self._parts
            while self._open and self._open[0].decided:
                sent = self._open.pop(0)
                decision = sent._decided
                if decision is None:
                    continue
                # chunks that wait for the same or a later iteration are overwritten
                while parts and parts[-1].begins >= decision.begins:
                    parts.pop()
                given = self._given
                way = ChunkWay(sent._sent, decision, self.profile, given.limits, given.switches)
                parts.append(ChunkPart(sent, way))
            # the plans of these parts do not change any more
            self._over = min(self._over, len(parts))
            changing = parts[self._over :]
            for part in changing:
                part.note_end()
            changing = [part for part in changing if part.last >= part.begins]
            parts[self._over :] = changing
            self._begin(changing, parts[self._over - 1] if self._over else None)
            published = self._arm.published
            for part, successor in itertools.pairwise(parts[max(0, self._over - 1) :]):
                if successor.known and successor.begins <= published:
                    part.end_in(successor.begins)
            while self._over < len(parts) - 1 and parts[self._over].is_over(published):
                self._over += 1
            # the history has the rows of parts that are over
            oldest = self._arm.oldest
            while len(parts) > 1 and parts[1].begins <= oldest:
                del parts[0]
                self._over = max(0, self._over - 1)

    def _begin(self, parts: list[ChunkPart], former: ChunkPart | None) -> None:
        """Sets the start of each part, as far as it is available."""
        for part in parts:
            has_begun = part.sent._begun is not None
            if part.known:
                pass
            elif former is not None and former.acts(part.begins - 1):
                if former.known:
                    part.begin(former.at(part.begins - 1, alone=True))
            elif has_begun:
                with contextlib.suppress(RowOverwritten, InvalidArgument):
                    part.begin(self._start_of(part))
            else:
                # it waits: if nobody else commands, resting actuators continue to rest
                latest = self._arm.latest()
                if part.start is None and not latest.active[self._actuators].any():
                    part.begin(self._rest_in(latest), known=False)
            former = part

    def _start_of(self, part: ChunkPart) -> Moment:
        """Reads places and derivatives before the begin of a begun chunk, from the journal.

        Raises RowOverwritten; InvalidArgument after a command without a journal.
        """
        before = part.begins - 1
        if not self._journal.exists:
            row = self._arm.wait_for(before)
            if not row.active[self._actuators].any():
                return self._rest_in(row)
            raise InvalidArgument(
                f"the plan of a chunk after a command needs the journal of '{self._arm.segment}': "
                "start the robot with one (--journal)"
            )
        while entries := self._journal.read(_ENTRIES):
            for entry in entries:
                if entry.kind == "chunk_begun":
                    of_it = self._starts.setdefault(entry.iteration, {})
                    of_it.update({(actuator, number): at for actuator, number, at in entry.starts})
        # starts of earlier chunks are not needed any more
        self._starts = {key: of_it for key, of_it in self._starts.items() if key >= part.begins}
        of_it = self._starts.get(part.begins, {})
        keys = self._given.keys
        moves = [not each for each in self._given.switches]
        if not all(key in of_it for key in itertools.compress(keys, moves)):
            if self._given.blends and part.begins in self._starts:
                raise InvalidArgument(
                    f"{self._given.blends} has no known plan, but an interpolation of its driver"
                )
            raise RowOverwritten(f"the journal no longer has the chunk that began in {part.begins}")
        starts = np.array([of_it.get(key, (0.0, 0.0, 0.0)) for key in keys]).reshape(-1, 3)
        places, slopes, curvatures = starts.T
        return places, slopes, curvatures

    def _rest_in(self, row: _core.Observation) -> Moment:
        places = self._given.desired(row)
        rests = np.zeros_like(places)
        return places, rests, rests

    # ------------------------------------------------------------------ its end

    def close(self) -> None:
        """Ends the plan: sent chunks are played to their last rows. May be called twice.

        Raises LaneFull if the end cannot be sent to the backend yet.
        """
        arm = self._arm
        if self._number in arm._open_plans and not arm._forked:
            with self._lock, contextlib.suppress(BackendGone, Closed):
                arm._close_plan(self._number)
            arm._open_plans.discard(self._number)
        self._closed = True

    def _leave(self, error: BaseException | None) -> None:
        self.close()
