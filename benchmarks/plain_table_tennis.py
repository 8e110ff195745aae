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

from o80_table_tennis.balls.trajectories import SampledFlight
from o80_table_tennis.rig.ball_records import BallWatch, RecordReader
from o80_table_tennis.settings import RigSettings, TaskSettings
from o80_table_tennis.task.actions import MUSCLES, changed_pressures
from o80_table_tennis.task.observations import JOINT_POSITIONS, JOINT_VELOCITIES, PRESSURES, SIZE
from o80_table_tennis.task.rewards import End
from o80_table_tennis.world.scene import MODEL

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

BALL = slice(PRESSURES.stop, SIZE)


class PlainEnvironment(gymnasium.Env[Float32Array, Float32Array]):
    """Same plant, model, observation and reward as the environment; nothing in between.

    `record` is the dtype of what happened to a ball, as the environment's twin publishes it.
    """

    def __init__(self, library: Path, record: np.dtype[Any]) -> None:
        self._library = ctypes.CDLL(str(library))
        self._library.plain_create.restype = ctypes.c_void_p
        plain = self._library.plain_create(str(MODEL).encode())
        if not plain:
            raise RuntimeError(f"{library.name} could not be set up")
        self._plain = ctypes.c_void_p(plain)
        self._seen = np.zeros(22 * 8 + record.itemsize, np.uint8)
        self._numbers = self._seen[: 22 * 8].view(np.float64)
        self._seen_at = ctypes.c_void_p(self._seen.ctypes.data)
        self._raw = np.empty(MUSCLES)
        self._raw_at = ctypes.c_void_p(self._raw.ctypes.data)

        task = self._task = TaskSettings()
        self.action_space = spaces.Box(-1.0, 1.0, (MUSCLES,), np.float32)
        self.observation_space = spaces.Box(task.bounds.low, task.bounds.high, (SIZE,), np.float32)
        ranges = RigSettings().pressures
        self._delay = ctypes.c_int(task.delay)
        self._watch = BallWatch(RecordReader(record, 22 * 8), end=task.end, reward=task.reward)
        self._least = np.array(ranges.least, dtype=np.float64)
        self._span = np.array(ranges.most, dtype=np.float64) - self._least
        self._low = task.bounds.low.astype(np.float64)
        self._high = task.bounds.high.astype(np.float64)
        self._over = True
        self.steps, self.seconds_stepping = 0, 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, dict[str, Any]]:
        """`options` bears the `flight` that is played."""
        super().reset(seed=seed)
        arm_seed = int(self.np_random.integers(2**32))
        flight: SampledFlight = (options or {})["flight"]
        self._flight = np.ascontiguousarray(np.hstack([flight.positions, flight.velocities]))
        self._library.plain_reset(
            self._plain,
            ctypes.c_uint64(arm_seed),
            ctypes.c_void_p(self._flight.ctypes.data),
            ctypes.c_size_t(len(self._flight)),
            self._seen_at,
        )
        self._steps, self._over = 0, False
        self._asked = (self._numbers[8:16] - self._least) / self._span
        observation = self._observe()
        end = self._watch.look(self._seen, float(self._numbers[17]), 0)
        return observation, self._info(end)

    def step(self, action: Float32Array) -> tuple[Float32Array, float, bool, bool, dict[str, Any]]:
        if self._over:
            raise gymnasium.error.ResetNeeded("the episode is over: call reset() before step()")
        called = time.perf_counter()
        self._asked = changed_pressures(self._asked, np.asarray(action), factor=self._task.factor)
        np.rint(self._least + self._asked * self._span, out=self._raw)
        self._library.plain_step(self._plain, self._raw_at, self._delay, self._seen_at)
        self._steps += 1
        observation = self._observe()
        y = float(self._numbers[17])
        end = self._watch.look(self._seen, y, self._steps)
        info = self._info(end)
        self.steps += 1
        self.seconds_stepping += time.perf_counter() - called
        if end is End.RUNNING:
            return observation, 0.0, False, False, info
        self._over = True
        return observation, self._watch.reward(y), end.terminated, end.truncated, info

    def _info(self, end: End) -> dict[str, Any]:
        return {
            "hit": self._watch.hit,
            "smallest_distance": self._watch.smallest_distance,
            "stalled": False,
            "end": end.value,
        }

    def _observe(self) -> Float32Array:
        numbers = self._numbers
        observation = np.empty(SIZE)
        observation[JOINT_POSITIONS] = numbers[0:4]
        observation[JOINT_VELOCITIES] = numbers[4:8]
        observation[PRESSURES] = (numbers[8:16] - self._least) / self._span
        observation[BALL] = numbers[16:22]
        return np.minimum(np.maximum(observation, self._low), self._high).astype(np.float32)

    def close(self) -> None:
        self._library.plain_destroy(self._plain)
