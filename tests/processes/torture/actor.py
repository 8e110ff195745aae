"""Actors of the fault campaign in Python: readers, commanders and bursters of C++ backends.

Reads one line of JSON for each actor from its standard input and forks it; the campaign adopts it.
"""

import json
import mmap
import os
import random
import struct
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from typing import Any

import o80

MASK = (1 << 64) - 1
MILLISECOND = 1_000_000
GRACE = 200 * MILLISECOND
ACT = 0
HANG, WRONG_ROW, FALSELY_TOLD, FALSE_DEATH, BAD_ERROR = 1, 2, 5, 6, 9
STATUSES = list(o80.Status)
UNDER_WAY, SENT, REFUSED = 1, 2, 3


def mix(a: int, b: int = 0) -> int:
    """As the C++ actors mix."""
    z = (a * 0x9E3779B97F4A7C15 + b + 0x632BE59BD9B4E019) & MASK
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & MASK
    z = (z ^ z >> 27) * 0x94D049BB133111EB & MASK
    return z ^ z >> 31


def stolen_time() -> int:
    """[ns] that the machine had no processor, as the C++ actors look it up."""
    with open("/proc/stat") as machine:
        ticks = int(machine.readline().split()[8])
    return ticks * (1_000_000_000 // os.sysconf("SC_CLK_TCK"))


class BrokenPromiseError(Exception):
    """A promise was broken."""


class Actor:
    """One process: its place on the board, its chance, its measured calls."""

    def __init__(self, order: dict[str, Any]) -> None:
        self.at: dict[str, int] = order["at"]
        self.parent = order["parent"]
        self.name: str = order["segment"]
        self.chance = random.Random(order["seed"])
        with open(order["board"], "r+b") as file:
            self.board = mmap.mmap(file.fileno(), 0)
        self.schedule = os.open("/proc/thread-self/schedstat", os.O_RDONLY)
        self.write("pid", "<i", os.getpid())

    def write(self, field: str, form: str, value: int, offset: int = 0) -> None:
        struct.pack_into(form, self.board, self.at[field] + offset, value)

    def read(self, field: str, form: str, offset: int = 0) -> int:
        value: int = struct.unpack_from(form, self.board, self.at[field] + offset)[0]
        return value

    def count(self, field: str, n: int = 1) -> None:
        self.write(field, "<Q", self.read(field, "<Q") + n)

    @property
    def acting(self) -> bool:
        return self.read("phase", "<I") == ACT and os.getppid() == self.parent

    def fail(self, fault: int, text: str) -> None:
        if self.read("fault", "<I") == 0:
            said = text.encode(errors="replace")[:590] + b"\0"
            self.board[self.at["fault_text"] : self.at["fault_text"] + len(said)] = said
            self.write("fault", "<I", fault)
        raise BrokenPromiseError(text)

    def starved(self) -> int:
        return int(os.pread(self.schedule, 64, 0).split()[1])

    def stopped(self) -> int:
        """[ns] so far; in a stop the board has it less the beginning of that."""
        value = self.read("stopped", "<q")
        return value if value >= 0 else value + time.monotonic_ns()

    def timeout(self) -> float:
        return self.chance.uniform(0.001, 0.25)

    @contextmanager
    def timed(self, what: str, timeout: float) -> Iterator[None]:
        """Judges how long a call took: of the time for which the process could run."""
        began, stopped, starved = time.monotonic_ns(), self.stopped(), self.starved()
        stolen = self.read("stolen", "<q")
        limit = int(timeout * 1e9) + GRACE
        self.write("call_ends", "<q", began + limit)
        self.count("calls")
        try:
            yield
        finally:
            took = time.monotonic_ns() - began
            self.write("call_ends", "<q", 0)
            if took > limit:
                took -= self.stopped() - stopped + self.starved() - starved
                took -= stolen_time() - stolen
                if took > limit:
                    self.fail(HANG, f"{what} took {took / 1e6:.1f} ms, timeout {timeout * 1e3:.1f}")

    def judge_gone(self, generation: int, error: Exception) -> None:
        base = generation * self.at["life_stride"]
        doomed = self.read("life_doomed", "<q", base)
        ending = self.read("life_ending", "<q", base)
        killed = isinstance(error, o80.BackendKilled)
        superseded = isinstance(error, o80.BackendSuperseded)
        wrong = (
            (killed and not doomed)
            or (superseded and not doomed and not ending)
            or (not killed and not superseded and not ending)
        )
        if wrong:
            self.fail(FALSE_DEATH, f"generation {generation} lives: {error}")


def generation_of(actor: Actor, robot: o80.Frontend) -> int:
    """By the epoch that its backend noted on the board."""
    for generation in reversed(range(actor.read("generations", "<I"))):
        if actor.read("life_epoch", "<Q", generation * actor.at["life_stride"]) == robot.epoch:
            return generation
    actor.fail(WRONG_ROW, "attached to a backend that nobody started")
    return -1


def verify(actor: Actor, generation: int, observation: Any, iteration: int | None = None) -> None:
    """A row is what it says of itself, and what the driver noted."""
    k = observation.iteration
    sensors = observation.extended
    filler = [mix(generation << 40 ^ k, i) for i in range(len(sensors["filler"]))]
    states = [
        struct.unpack("<2Q", values.astype("<f8").tobytes())
        for values in (observation.desired, observation.observed)
    ]
    digest = mix(generation, k) ^ mix(int(sensors["chain"]), 1)
    for value in (*filler, *chain.from_iterable(zip(*states, strict=True))):
        digest = mix(digest, value)
    noted = actor.read(
        "journal", "<Q", generation * actor.at["life_stride"] + k * actor.at["journal_stride"]
    )
    found = (sensors["generation"], [*sensors["filler"]], sensors["digest"], noted)
    if found != (generation, filler, digest, digest) or iteration not in (None, k):
        actor.fail(WRONG_ROW, f"row {k} of generation {generation}, asked for as {iteration}")
    actor.count("rows")


class Ledger:
    """Ledger of a commander, laid out as the C++ ones do."""

    def __init__(self, actor: Actor) -> None:
        self.actor = actor

    @property
    def has_room(self) -> bool:
        at = self.actor.at
        batches = self.actor.read("batches", "<I")
        commands = self.actor.read("commands", "<I")
        return batches + 4 < at["max_batches"] and commands + 16 < at["max_commands"]

    def command(self, bits: int, actuator: int) -> None:
        actor = self.actor
        place = actor.read("commands", "<I")
        base = actor.at["sent_commands"] + place * actor.at["command_stride"]
        struct.pack_into("<QII", actor.board, base, bits, 0, actuator)
        actor.write("commands", "<I", place + 1)

    def batch(self, generation: int, first: int) -> int:
        """Before a pulse."""
        actor = self.actor
        place = actor.read("batches", "<I")
        base = actor.at["sent_batches"] + place * actor.at["batch_stride"]
        commands = actor.read("commands", "<I") - first
        no_lane = 0xFFFFFFFF
        struct.pack_into(
            "<7I", actor.board, base, UNDER_WAY, generation, no_lane, first, commands, 0, 0
        )
        struct.pack_into("<Qqqqq", actor.board, base + 32, 0, -1, 0, -1, -1)
        actor.write("batches", "<I", place + 1)
        return base

    def outcome(self, base: int, sent: int) -> None:
        struct.pack_into("<I", self.actor.board, base, sent)

    def settle(self, base: int, batch: Any) -> None:
        actor = self.actor
        first = struct.unpack_from("<I", actor.board, base + 12)[0]
        for i, handle in enumerate(batch.handles):
            at = actor.at["sent_commands"] + (first + i) * actor.at["command_stride"]
            iteration = -1 if handle.iteration is None else handle.iteration
            told = STATUSES.index(handle.status)
            struct.pack_into("<q", actor.board, at + actor.at["told_at"], iteration)
            struct.pack_into("<I", actor.board, at + actor.at["told"], told)


def add_some(actor: Actor, robot: o80.Frontend, ledger: Ledger) -> None:
    for _ in range(actor.chance.randint(1, 5)):
        bits = 0x3FF0000000000000 | actor.chance.getrandbits(52)
        target = struct.unpack("<d", struct.pack("<Q", bits))[0]
        actuator = actor.chance.randrange(2)
        ledger.command(bits, actuator)
        mode = o80.Mode.OVERWRITE if actor.chance.random() < 0.2 else o80.Mode.QUEUE
        if actor.chance.random() < 0.4:
            robot.add_command(actuator, target, iterations=actor.chance.randint(1, 15), mode=mode)
        else:
            robot.add_command(actuator, target, mode=mode)


def command(actor: Actor, robot: o80.Frontend, generation: int) -> None:
    """Sends, waits for some, and notes what it is told."""
    ledger = Ledger(actor)
    open_batches: list[tuple[int, Any]] = []
    try:
        while actor.acting and ledger.has_room:
            first = actor.read("commands", "<I")
            add_some(actor, robot, ledger)
            base = ledger.batch(generation, first)
            try:
                batch = (
                    robot.burst(actor.chance.randint(1, 8), wait=False).batch
                    if (robot.bursting)
                    else robot.pulse()
                )
            except (o80.LaneFull, o80.NoLane, o80.BackendGone) as error:
                ledger.outcome(base, REFUSED)
                robot.forget_added()
                if isinstance(error, o80.BackendGone):
                    raise
                time.sleep(0.002)
                continue
            ledger.outcome(base, SENT)
            open_batches.append((base, batch))
            timeout = actor.timeout()
            try:
                with actor.timed("batch.wait in Python", timeout):
                    batch.wait(timeout, check=False)
            except o80.TimeoutError:
                actor.count("timeouts")
            while len(open_batches) > 20:
                ledger.settle(*open_batches.pop(0))
    finally:
        for entry in open_batches:
            ledger.settle(*entry)


def read(actor: Actor, robot: o80.Frontend, generation: int) -> None:
    """Reads in every way there is."""
    while actor.acting:
        timeout = actor.timeout()
        try:
            match actor.chance.randrange(4):
                case 0:
                    verify(actor, generation, robot.latest())
                case 1:
                    k = max(0, robot.published + actor.chance.randint(-10, 10))
                    with actor.timed("wait_for in Python", timeout):
                        observation = robot.wait_for(k, timeout=timeout)
                    verify(actor, generation, observation, k)
                case 2:
                    rows = robot.history(actor.chance.randint(1, 30))
                    for i in range(len(rows)):
                        verify(actor, generation, rows[i], rows[0].iteration + i)
                case _:
                    stream(actor, robot, generation, timeout)
        except o80.TimeoutError:
            actor.count("timeouts")
        except o80.RowOverwritten:
            pass


def stream(actor: Actor, robot: o80.Frontend, generation: int, timeout: float) -> None:
    before = -1
    rows = iter(robot.stream(timeout=timeout))
    for _ in range(10):
        with actor.timed("stream in Python", timeout):
            observation = next(rows)
        verify(actor, generation, observation)
        if observation.iteration <= before:
            actor.fail(WRONG_ROW, f"row {observation.iteration} came after row {before}")
        before = observation.iteration


def act(actor: Actor, role: str) -> None:
    timeout = 5.0
    robot: o80.Frontend | None = None
    while actor.acting:
        timeout = actor.timeout()
        try:
            with actor.timed("attach in Python", timeout):
                if robot is None:
                    robot = o80.Frontend(actor.name, timeout, on_error="continue")
                else:
                    robot.reattach(timeout)
        except (o80.TimeoutError, o80.BackendFailed):
            continue
        generation = generation_of(actor, robot)
        try:
            (read if role == "reader" else command)(actor, robot, generation)
        except o80.BackendGone as error:
            actor.judge_gone(generation, error)
    if robot is not None:
        robot.close()


def play(order: dict[str, Any]) -> int:
    os.environ["O80_DIRECTORY"] = order["directory"]
    actor = Actor(order)
    try:
        act(actor, order["role"])
    except BrokenPromiseError:
        return 1
    except BaseException as error:
        try:
            actor.fail(BAD_ERROR, f"{type(error).__name__}: {error}")
        except BrokenPromiseError:
            return 1
    return 0


def main() -> None:
    for line in sys.stdin:
        order = json.loads(line)
        middle = os.fork()
        if middle == 0:
            if os.fork() == 0:
                os._exit(play(order))
            os._exit(0)
        os.waitpid(middle, 0)


if __name__ == "__main__":
    main()
