"""A policy that answers late, played by chunks, by queues of actions, and naively.

Simulated time: an arm of one joint at 500 Hz, a filtered random path as the truth, and a policy
that knows it but for a disagreement of each answer. Delays are drawn once and are the same for all
players, with outliers and losses; the policy is asked again when it has answered. The players:

chunks: Frontend.chunks, all rows in their iterations (`fixed`).
queue: the rule of LeRobot's ActionQueue (0.4.4) with real-time chunking: drops as many actions as
    the latency has steps, rounded up. Its own class gives the same figures.
naive: each answer is played from its first action on.

The last two show one action a step, in straight lines between them, as LeRobot 0.6 does.
"""

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from sampling import sample

Places = NDArray[np.float64]

RATE = 500  # [Hz]
LENGTH = 30 * RATE  # iterations
HORIZON = 1.5  # of an answer [s]
TAKE_OVER = RATE // 10  # iterations in which a take-over is looked at


class Arm:
    """One joint that is where it was asked to be."""

    actuators = ("lift",)
    simulated = True

    def __init__(self) -> None:
        self.place = np.zeros(1)

    def write(self, desired: Any) -> None:
        self.place = np.array(desired.states)

    def read(self, reading: Any) -> None:
        reading.observed = self.place


@dataclass(frozen=True)
class Answer:
    """An answer about the row `seen`, that came in iteration `at`; without actions: it was lost."""

    seen: int
    at: int
    actions: Places


@dataclass(frozen=True)
class World:
    truth: Places  # (iterations,) [rad]
    step: int  # iterations from action to action
    answers: list[Answer]


@dataclass
class Played:
    places: Places = field(default_factory=lambda: np.zeros(LENGTH))
    misplaced: list[float] = field(default_factory=list)  # of each action [s]
    starved: int = 0  # iterations


def world_of(seed: int, delay: float, disagreement: float, actions_a_second: int) -> World:
    """delay: the median [s]. disagreement: of two answers about the same time [rad]."""
    random = np.random.default_rng(seed)
    noise = np.random.default_rng(0).normal(size=LENGTH + 4 * RATE)  # one truth for all
    for _ in range(2):  # a second in each filter
        window = np.hanning(RATE)
        noise = np.convolve(noise, window / window.sum(), "same")
    truth = 0.5 * noise / noise.std()
    truth -= truth[0]
    step = RATE // actions_a_second
    ahead = step * np.arange(1, round(HORIZON * actions_a_second) + 1)
    answers, seen = [], 0
    while seen < LENGTH:
        drawn = random.lognormal(math.log(delay), 0.15) * (2 if random.random() < 0.05 else 1)
        at = seen + max(1, round(min(drawn, HORIZON / 2) * RATE))
        rows = truth[np.minimum(seen + ahead, len(truth) - 1)]
        rows = rows + random.normal(0.0, disagreement / math.sqrt(2))
        answers.append(Answer(seen, at, rows[: 0 if random.random() < 0.02 else None]))
        seen = at
    return World(truth[:LENGTH], step, answers)


def by_chunks(world: World) -> Played:
    played = Played()
    with o80.robots.load(Arm).inline(frequency=RATE, history=LENGTH + 10) as arm:
        sents = []
        with arm.chunks("lift", step=world.step) as plan:
            for answer in world.answers:
                arm.burst(min(answer.at, LENGTH) - 1 - arm.published)
                if answer.at >= LENGTH:
                    break
                if len(answer.actions):
                    sent = plan.send(answer.actions, seen=answer.seen, fixed=True)
                    sents.append((answer, sent))
        rows = arm.history()
        played.places[1:] = rows.desired[1:LENGTH, 0]
        begun = min(sent.begins or LENGTH for _, sent in sents)
        played.starved = int((~rows.active[begun:LENGTH, 0]).sum())
    ends = [sent.begins for _, sent in sents[1:]] + [LENGTH]
    for (answer, sent), end in zip(sents, ends, strict=True):
        if sent.begins is None or sent.first is None or sent.shift is None:
            continue
        for row in range(sent.first, len(answer.actions)):
            due = answer.seen + (row + 1) * world.step + sent.shift
            if due < min(end or LENGTH, LENGTH):
                wrong = played.places[due] != answer.actions[row]
                played.misplaced.append((sent.shift + int(wrong)) / RATE)
    return played


def by_queue(world: World, *, drops: bool) -> Played:
    """One action a step, interpolated in straight lines. drops: what came too late."""
    played = Played()
    queue: list[tuple[int, float]] = []  # actions with their numbers
    arrivals = iter([*world.answers, Answer(0, 10 * LENGTH, np.zeros(0))])
    coming = next(arrivals)
    newest: Answer | None = None
    place = 0.0
    for tick in range(0, LENGTH - world.step, world.step):
        while coming.at <= tick:
            latency = math.ceil((coming.at - coming.seen) / world.step)
            if len(coming.actions):
                queue = list(enumerate(coming.actions))[latency if drops else 0 :]
                newest = coming
            coming = next(arrivals)
        after = tick + world.step
        if not queue or newest is None:
            played.starved += world.step
            target = place
        else:
            number, target = queue.pop(0)
            due = newest.seen + (number + 1) * world.step
            played.misplaced.append(abs(due - after) / RATE)
        played.places[tick + 1 : after + 1] = np.linspace(place, target, world.step + 1)[1:]
        place = target
    played.places[after + 1 :] = place
    return played


PLAYERS: dict[str, Callable[[World], Played]] = {
    "chunks": by_chunks,
    "queue": partial(by_queue, drops=True),
    "naive": partial(by_queue, drops=False),
}


def figures(world: World, played: Played) -> dict[str, float]:
    """Without the first two seconds, in which each begins in its own way."""
    changes = np.abs(np.diff(played.places, 2)) * RATE  # of the velocity, in an iteration [rad/s]
    taking = np.zeros(LENGTH, bool)
    for answer in world.answers:
        taking[answer.at : answer.at + TAKE_OVER] = True
    taking, later = taking[2:], np.arange(2, LENGTH) > 2 * RATE
    error = (played.places - world.truth)[2 * RATE :]
    rest = changes[~taking & later]
    misplaced = np.array(played.misplaced)
    return {
        "error [mrad]": 1e3 * float(np.sqrt(np.mean(error**2))),
        "take-over [rad/s]": float(changes[taking & later].max()),
        "rest [rad/s]": float(rest.max()) if len(rest) else math.nan,
        "starved [%]": 100.0 * played.starved / LENGTH,
        "misplaced [ms]": 1e3 * float(misplaced.max(initial=0.0)),
        "wrong rows [%]": 100.0 * float(np.mean(misplaced > 0.5 / RATE)),
    }


def cases() -> Iterator[tuple[float, float, int]]:
    for delay in (0.08, 0.15, 0.3):
        for disagreement in (0.005, 0.02, 0.05):
            for actions_a_second in (20, 50):
                yield delay, disagreement, actions_a_second


def main() -> None:
    print_table = sys.argv[1:2] == ["--table"]
    worst = {"wrong": 0.0, "share": 0.0}
    most: dict[tuple[str, int], float] = {}  # of changes of velocity, for a rate of actions
    for case, (delay, disagreement, actions) in enumerate(cases()):
        world = world_of(case, delay, disagreement, actions)
        found = {name: figures(world, play(world)) for name, play in PLAYERS.items()}
        if print_table:
            print(f"{1e3 * delay:.0f} ms, {1e3 * disagreement:.0f} mrad, {actions} actions/s")
            for name, values in found.items():
                print(f"  {name:9}", *(f"{key} {value:.3g};" for key, value in values.items()))
        ours = found["chunks"]
        worst["wrong"] = max(worst["wrong"], ours["wrong rows [%]"])
        # with short delays nearly every iteration belongs to a take-over: the rest is that of all
        for part in ("take-over [rad/s]", "rest [rad/s]"):
            most[part, actions] = max(most.get((part, actions), 0.0), ours[part])
        if delay == 0.3:
            share = ours["take-over [rad/s]"] / found["queue"]["take-over [rad/s]"]
            worst["share"] = max(worst["share"], share)
    if not print_table:
        sample("chunks_wrong", "%", worst["wrong"])
        ratios = (most["take-over [rad/s]", n] / most["rest [rad/s]", n] for n in (20, 50))
        sample("chunks_take_over", "x", max(ratios))
        sample("chunks_take_over_share", "x", worst["share"])


if __name__ == "__main__":
    main()
