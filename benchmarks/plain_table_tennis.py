"""The table-tennis environment in one process and without o80, step for step the same.

A Gymnasium environment like the other: what a user would write who needs neither processes nor
history. Both refuse steps of an episode that is over, and count steps and time.
"""

import ctypes
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from o80.base.loop_options import text_of
from o80_table_tennis.balls.sampled_flight import SampledFlight
from o80_table_tennis.rig.ball_records import BallReader, ball_options
from o80_table_tennis.rig.pressure_range import PressureRange
from o80_table_tennis.settings import TaskSettings
from o80_table_tennis.task.actions import changed_pressures
from o80_table_tennis.task.box import ObservationBox
from o80_table_tennis.task.end import End
from o80_table_tennis.task.state import State
from o80_table_tennis.world.arm import JOINT_NAMES, MUSCLES
from o80_table_tennis.world.scene import MODEL
from o80_table_tennis.world.timing import PERIOD

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]


class PlainEnvironment(gymnasium.Env[Float32Array, Float32Array]):
    """Same plant, model, observation and reward as the environment; nothing in between.

    `record` is the dtype of the contacts of a ball, as the environment's twin publishes them;
    `pressures` are the range of its arm, `preset` names the numbers of it.
    """

    def __init__(
        self,
        library: Path,
        record: np.dtype[Any],
        pressures: PressureRange,
        preset: str = "standard",
    ) -> None:
        self.library = ctypes.CDLL(str(library))
        plain = self._create(preset)
        if not plain:
            raise RuntimeError(f"{library.name} could not be set up")
        self.handle = ctypes.c_void_p(plain)
        self._seen = np.zeros(22 * 8 + record.itemsize, np.uint8)
        self._numbers = self._seen[: 22 * 8].view(np.float64)
        self._seen_at = ctypes.c_void_p(self._seen.ctypes.data)
        self._raw = np.empty(MUSCLES)
        self._raw_at = ctypes.c_void_p(self._raw.ctypes.data)

        self._settings = TaskSettings()
        self._task = self._settings.made()
        self._box = ObservationBox(self._task)
        self.action_space = spaces.Box(-1.0, 1.0, (MUSCLES,), np.float32)
        self.observation_space = self._box.space
        self.pressures = pressures
        self._delay = ctypes.c_int(self._settings.delay)
        self._reader = BallReader(record, 22 * 8)
        self._goal = self._task.begin(self.np_random)
        self._racket = np.full(3, np.nan)  # no task with a ball looks at it
        self._over = True
        self.steps, self.seconds_stepping = 0, 0.0

    def _create(self, preset: str) -> int | None:
        options = {
            "model": MODEL,
            "joints": JOINT_NAMES,
            "timestep": PERIOD,
            **ball_options(1),
        }
        texts = ctypes.c_char_p * len(options)
        self.library.plain_create.restype = ctypes.c_void_p
        plain: int | None = self.library.plain_create(
            preset.encode(),
            texts(*(name.encode() for name in options)),
            texts(*(text_of(value).encode() for value in options.values())),
            ctypes.c_size_t(len(options)),
        )
        return plain

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, dict[str, Any]]:
        """`options` bears the `flight` that is played."""
        super().reset(seed=seed)
        arm_seed = int(self.np_random.integers(2**32))
        flight: SampledFlight = (options or {})["flight"]
        self._flight = flight.states
        self.library.plain_reset(
            self.handle,
            ctypes.c_uint64(arm_seed),
            ctypes.c_void_p(self._flight.ctypes.data),
            ctypes.c_size_t(len(self._flight)),
            self._seen_at,
        )
        self._steps, self._over = 0, False
        self.asked = self.pressures.normalised(self._numbers[8:16])
        state = self._look()
        return self._box.clip(self._task.observe(state)), self._info(state, End.RUNNING)

    def step(self, action: Float32Array) -> tuple[Float32Array, float, bool, bool, dict[str, Any]]:
        if self._over:
            raise gymnasium.error.ResetNeeded("the episode is over: call reset() before step()")
        called = time.perf_counter()
        self.asked = changed_pressures(self.asked, np.asarray(action), factor=self._settings.factor)
        self._raw[...] = self.pressures.raw(self.asked)
        self.library.plain_step(self.handle, self._raw_at, self._delay, self._seen_at)
        self._steps += 1
        state = self._look()
        observation = self._box.clip(self._task.observe(state))
        end, reward = End.RUNNING, 0.0
        if self._task.eventful(state):
            end, reward = End(int(self._task.end(state))), float(self._task.reward(state))
        info = self._info(state, end)
        self.steps += 1
        self.seconds_stepping += time.perf_counter() - called
        if end is End.RUNNING:
            return observation, reward, False, False, info
        self._over = True
        return observation, reward, end.terminated, end.truncated, info

    def _look(self) -> State:
        numbers = self._numbers
        return State(
            self._steps,
            numbers[0:8],
            self.pressures.normalised(numbers[8:16]),
            self._racket,
            numbers[16:22],
            self._reader.read(self._seen),
            self._goal,
        )

    def _info(self, state: State, end: End) -> dict[str, Any]:
        info = self._task.info(state)
        info["stalled"] = False
        info["end"] = end.text
        return info

    def close(self) -> None:
        self.library.plain_destroy(self.handle)
