"""Steps a second of table tennis in many copies on two threads, resets included.

Beside them, in the same run: the same plants and simulations stepped and reset by plain calls of
C++ on two threads, and as many processes under Gymnasium's AsyncVectorEnv. All of it with the
standard arm, which `gymnasium.make_vec` takes, and with the identified one, which trainings take.
"""

import ctypes
import threading
from contextlib import ExitStack, closing
from functools import partial
from typing import Any

import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, VectorEnv
from numpy.typing import NDArray

from o80.base.loop_options import text_of
from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.entry_points import accelerated_environment, vector_environment
from o80_table_tennis.rig.ball_records import ball_options
from o80_table_tennis.settings import RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE, changed_pressures
from o80_table_tennis.world.arm import JOINT_NAMES, MUSCLES
from o80_table_tennis.world.scene import MODEL
from o80_table_tennis.world.timing import PERIOD
from sampling import built, rounds, sample, seconds, take_priority

THREADS = 2
COPIES = (64, 16)
PRESETS = {"standard": "", "identified": "identified_"}
"""Presets of the arm, with the beginnings of the names of their figures."""
PROCESSES = 16
COPY_STEPS = 16_000  # of all copies together, in a round
TASK = TaskSettings(factor=COARSE)


class Plain:
    """As many plants and simulations, stepped by plain calls on two threads."""

    def __init__(self, stack: ExitStack, rig: RigSettings, copies: int, episode: int) -> None:
        self._library = library = ctypes.CDLL(str(built() / "lib" / "plain_table_tennis.so"))
        self._episode, self._step = episode, 0
        balls = balls_from(None, 0, PERIOD)
        flights = [balls.flight(number).states[:1] for number in range(copies)]
        self._flights = np.vstack(flights)
        options = {"model": MODEL, "joints": JOINT_NAMES, "timestep": PERIOD, **ball_options()}
        texts = ctypes.c_char_p * len(options)
        names = texts(*(name.encode() for name in options))
        values = texts(*(text_of(value).encode() for value in options.values()))
        library.plain_create.restype = ctypes.c_void_p
        self._all: list[int] = []
        for flight in flights:
            at = ctypes.c_void_p(flight.ctypes.data)
            size = ctypes.c_size_t(len(options))
            plain = library.plain_create(rig.preset.encode(), names, values, size, at)
            if not plain:
                raise RuntimeError("the plain calls could not be set up")
            self._all.append(plain)
            stack.callback(library.plain_destroy, ctypes.c_void_p(plain))
        # those of random actions
        with closing(accelerated_environment(rig=rig)) as one:
            pressures, commanded = one.task.range, one.task.commanded()[0]
        raw = []
        for action in random_actions(episode, MUSCLES):
            commanded = changed_pressures(commanded, action, factor=TASK.factor)
            raw.append(pressures.raw(commanded))
        self._raw = np.array(raw)

    def play(self, steps: int) -> None:
        share = len(self._all) // THREADS
        workers = [
            threading.Thread(target=self._play_some, args=(slice(begin, begin + share), steps))
            for begin in range(0, len(self._all), share)
        ]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        self._step += steps

    def _play_some(self, which: slice, steps: int) -> None:
        """In a thread of its own; ctypes releases the interpreter meanwhile."""
        chosen = self._all[which]
        self._library.plain_play(
            (ctypes.c_void_p * len(chosen))(*chosen),
            ctypes.c_size_t(len(chosen)),
            ctypes.c_size_t(self._step),
            ctypes.c_size_t(self._step + steps),
            ctypes.c_size_t(self._episode),
            ctypes.c_void_p(self._raw.ctypes.data),
            ctypes.c_void_p(self._flights[which].ctypes.data),
        )


class Played:
    """A vector environment under random actions."""

    def __init__(self, environment: VectorEnv[Any, Any, Any]) -> None:
        self._environment = environment
        self._actions = random_actions(64, environment.num_envs, MUSCLES)
        self._steps = self._ends = 0
        environment.reset(seed=1)

    def play(self, steps: int) -> None:
        for step in range(steps):
            stepped = self._environment.step(self._actions[step % 64])
            self._ends += int(np.count_nonzero(stepped[2] | stepped[3]))
        self._steps += steps * self._environment.num_envs

    @property
    def episode(self) -> int:
        """Steps of an episode, on average."""
        return round(self._steps / self._ends)


def random_actions(*shape: int) -> NDArray[np.float32]:
    return np.random.default_rng(1).uniform(-1, 1, shape).astype(np.float32)


def measure(copies: int, preset: str) -> None:
    rig = RigSettings(preset=preset)
    with ExitStack() as stack:
        vector = vector_environment(
            num_envs=copies,
            threads=THREADS,
            task=TASK,
            rig=rig,
            autoreset_mode=AutoresetMode.SAME_STEP,
        )
        played: dict[str, Played | Plain] = {"vector": Played(stack.enter_context(vector))}
        if copies == PROCESSES and preset == "standard":
            processes = AsyncVectorEnv(
                [partial(accelerated_environment, task=TASK, rig=rig)] * copies,
                autoreset_mode=AutoresetMode.SAME_STEP,
            )
            played["async"] = Played(stack.enter_context(closing(processes)))
        steps = COPY_STEPS // copies
        first = played["vector"]
        assert isinstance(first, Played)
        first.play(steps)
        played["plain"] = Plain(stack, rig, copies, first.episode)
        for each in played.values():
            each.play(steps // 8)  # everybody warms up
        for _ in range(rounds()):
            for name, each in played.items():
                taken = seconds(partial(each.play, steps))
                sample(f"{PRESETS[preset]}{name}_{copies}", "steps/s", copies * steps / taken)


def main() -> None:
    take_priority()
    for preset in PRESETS:
        for copies in COPIES:
            measure(copies, preset)


if __name__ == "__main__":
    main()
