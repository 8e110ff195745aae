"""A replay buffer of Stable-Baselines3 that takes the transitions of whole motions."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.buffers import ReplayBuffer

from .hindsight import Transitions


class MotionBuffer(ReplayBuffer):
    """A ring: the oldest transitions give way."""

    def __init__(self, size: int, observations: spaces.Space, actions: spaces.Space) -> None:  # type: ignore[type-arg]
        super().__init__(size, observations, actions, device="cpu", handle_timeout_termination=True)

    def extend(self, new: Transitions) -> None:
        """Adds them all. Raises ValueError for more than the buffer holds."""
        count = len(new.rewards)
        if count > self.buffer_size:
            raise ValueError(
                f"a motion of {count} transitions does not fit into a buffer of {self.buffer_size}"
            )
        at = (self.pos + np.arange(count)) % self.buffer_size
        self.observations[at, 0] = new.observations
        self.next_observations[at, 0] = new.next_observations
        self.actions[at, 0] = new.actions
        self.rewards[at, 0] = new.rewards
        self.dones[at, 0] = new.terminated
        self.timeouts[at, 0] = False
        self.full = self.full or self.pos + count >= self.buffer_size
        self.pos = (self.pos + count) % self.buffer_size
