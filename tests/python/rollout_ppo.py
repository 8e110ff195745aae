"""Models of PPO for the tests of rollouts."""

from copy import deepcopy
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from o80.learning.rollouts import Collector
from o80.learning.rollouts.ppo import CollectorEnv, RolloutPPO


def model_of(collector: Collector, *, steps: int, batch: int = 80, **options: Any) -> RolloutPPO:
    return RolloutPPO(
        "MlpPolicy",
        VecNormalize(CollectorEnv(collector), norm_reward=False),
        n_steps=steps,
        batch_size=batch,
        n_epochs=4,
        learning_rate=2e-3,
        seed=3,
        device="cpu",
        **options,
    )


class copied:  # noqa: N801 - a verb
    """Copy of a model's state: weights, optimiser, statistics, generators."""

    def __init__(self, model: PPO) -> None:
        normalisation = model.get_vec_normalize_env()
        assert normalisation is not None
        self._policy, self._state = model.policy, deepcopy(model.policy.state_dict())
        self._optimiser = deepcopy(model.policy.optimizer.state_dict())
        self.statistics = deepcopy(normalisation.obs_rms)
        self.gamma, self.trace, self.steps = model.gamma, model.gae_lambda, model.num_timesteps
        self._epsilon, self._clip = normalisation.epsilon, normalisation.clip_obs
        self._torch, self._numpy = torch.get_rng_state(), np.random.get_state()  # noqa: NPY002

    def weights(self) -> bytes:
        return b"".join(each.numpy().tobytes() for each in self._state.values())

    def values(self, observations: Any) -> Any:
        """Predicts the values (...) of observations (..., M)."""
        statistics: Any = self.statistics
        seen = (observations - statistics.mean) / np.sqrt(statistics.var + self._epsilon)
        tensor = torch.as_tensor(np.clip(seen, -self._clip, self._clip), dtype=torch.float32)
        now = deepcopy(self._policy.state_dict())
        self._policy.load_state_dict(self._state)
        with torch.no_grad():
            values = self._policy.predict_values(tensor.reshape(-1, tensor.shape[-1]))
        self._policy.load_state_dict(now)
        return values.numpy().reshape(np.shape(observations)[:-1])

    def into(self, model: PPO) -> None:
        normalisation = model.get_vec_normalize_env()
        assert normalisation is not None
        model.policy.load_state_dict(self._state)
        model.policy.optimizer.load_state_dict(self._optimiser)
        normalisation.obs_rms = deepcopy(self.statistics)
        model.num_timesteps = self.steps
        torch.set_rng_state(self._torch)
        np.random.set_state(self._numpy)  # noqa: NPY002
