"""PPO of Stable-Baselines3, trained on the rollouts of a Collector.

with Collector(make, seed=1) as collector:
    model = RolloutPPO("MlpPolicy", VecNormalize(CollectorEnv(collector), norm_reward=False))
    model.learn(1_000_000)

Needs the extra `stable-baselines3`. See docs/learning/rollouts.md.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.learning.rollouts.collector import Collector
from o80.learning.rollouts.rollout import Rollout
from o80.learning.rollouts.sb3_policy import gaussian_policy

needed("stable_baselines3", "stable-baselines3", "o80.learning.rollouts.ppo")

import torch  # noqa: E402
from stable_baselines3 import PPO  # noqa: E402
from stable_baselines3.common.buffers import RolloutBuffer  # noqa: E402
from stable_baselines3.common.callbacks import BaseCallback  # noqa: E402
from stable_baselines3.common.logger import Logger  # noqa: E402
from stable_baselines3.common.vec_env import VecEnv  # noqa: E402

Info = dict[str, Any]

ALONE = "a collector steps its copies itself: give CollectorEnv to a RolloutPPO only"


class CollectorEnv(VecEnv):
    """The copies of a collector as the environment of a RolloutPPO; it cannot step them."""

    def __init__(self, collector: Collector) -> None:
        self.collector = collector
        self.render_mode = None
        super().__init__(collector.copies, collector.observation_space, collector.action_space)

    def reset(self) -> Any:
        """Returns zeros: a rollout begins with the observations of the collector."""
        space = self.observation_space
        return np.zeros((self.num_envs, *(space.shape or ())), space.dtype)

    def step_async(self, actions: Any) -> None:
        """Not supported: raises InvalidArgument."""
        raise InvalidArgument(ALONE)

    def step_wait(self) -> Any:
        """Not supported: raises InvalidArgument."""
        raise InvalidArgument(ALONE)

    def close(self) -> None:
        """Closes the collector."""
        self.collector.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Returns an attribute of this object, once for each copy."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not supported: raises InvalidArgument."""
        raise InvalidArgument(f"set '{attr_name}' where the collector's environments are made")

    def env_method(self, method_name: str, *_: Any, indices: Any = None, **__: Any) -> list[Any]:
        """Not supported: raises InvalidArgument."""
        raise InvalidArgument(f"'{method_name}' cannot be called in a collector's environments")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Returns whether ends have the info `episode`, like ends in a Monitor."""
        from stable_baselines3.common.monitor import Monitor

        return [issubclass(Monitor, wrapper_class)] * len(list(self._get_indices(indices)))


class RolloutPPO(PPO):
    """PPO with rollouts of a collector, collected with the weights of the last update.

    The environment must be a CollectorEnv, or a VecNormalize of one without `norm_reward`.
    Statistics of observations are updated after each rollout, not in each step. The iteration is
    the number of updates; for a loaded model the collector restarts in its iteration.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        """arguments, options: those of PPO."""
        super().__init__(*arguments, **options)
        if not self.verbose and self.tensorboard_log is None:
            self.set_logger(Logger(None, []))  # the default one leaves a folder in /tmp
        normalisation = self._vec_normalize_env
        inner = normalisation.unwrapped if normalisation is not None else self.env
        if not isinstance(inner, CollectorEnv) or (normalisation and normalisation.norm_reward):
            raise InvalidArgument(
                "RolloutPPO needs a CollectorEnv, or VecNormalize(CollectorEnv(collector), "
                f"norm_reward=False), got {self.env!r}"
            )
        self._collector = inner.collector
        gaussian_policy(self.policy, self._vec_normalize_env)  # may refuse

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "_collector"]

    def _setup_learn(self, *arguments: Any, **options: Any) -> Any:
        """Sets up learning without the zeros of CollectorEnv.reset in the statistics."""
        normalisation = self._vec_normalize_env
        if normalisation is None:
            return super()._setup_learn(*arguments, **options)
        training, normalisation.training = normalisation.training, False
        try:
            return super()._setup_learn(*arguments, **options)
        finally:
            normalisation.training = training

    def collect_rollouts(
        self,
        env: VecEnv,
        callback: BaseCallback,
        rollout_buffer: RolloutBuffer,
        n_rollout_steps: int,
    ) -> bool:
        """Fills the buffer with a rollout."""
        self.policy.set_training_mode(False)
        rollout_buffer.reset()
        callback.on_rollout_start()
        rollout = self._collected(n_rollout_steps)
        over, ends = rollout.terminated | rollout.truncated, _Ends(rollout)
        steps = len(rollout.rewards)  # more than requested, if the collector ends episodes
        if steps != rollout_buffer.buffer_size:
            rollout_buffer.buffer_size = steps
            rollout_buffer.reset()
        rewards, values, log_probabilities = self._valued(rollout, ends)
        starts = self._last_episode_starts
        normalised = self._normalised(rollout.observations)
        for step in range(steps):
            self.num_timesteps += self.n_envs
            dones, infos = over[step], ends.infos(step)
            known = {"rewards": rollout.rewards[step], "dones": dones, "infos": infos}
            callback.update_locals(known)
            if not callback.on_step():
                return False
            self._update_info_buffer(infos, dones)
            rollout_buffer.add(
                normalised[step],
                rollout.actions[step],
                rewards[step],
                starts,  # type: ignore[arg-type]
                values[step],
                log_probabilities[step],
            )
            starts = dones
        self._last_episode_starts = starts
        self._last_obs = normalised[-1]
        rollout_buffer.compute_returns_and_advantage(last_values=values[-1], dones=starts)  # type: ignore[arg-type]
        if self._vec_normalize_env is not None and self._vec_normalize_env.training:
            statistics: Any = self._vec_normalize_env.obs_rms
            statistics.update(rollout.observations[:-1].reshape(-1, *env.observation_space.shape))  # type: ignore[misc]
        callback.on_rollout_end()
        return True

    def _collected(self, steps: int) -> Rollout:
        """Collects the rollout of this model's iteration."""
        iteration = self.num_timesteps // (steps * self.n_envs)
        if self._collector.iteration != iteration:
            self._collector.restart(iteration)
        policy = gaussian_policy(self.policy, self._vec_normalize_env)
        return self._collector.collect(policy, steps=steps)

    def _normalised(self, observations: NDArray[Any]) -> NDArray[Any]:
        if self._vec_normalize_env is None:
            return observations
        normalised: Any = self._vec_normalize_env.normalize_obs(observations)
        return normalised  # type: ignore[no-any-return]

    def _valued(self, rollout: Rollout, ends: "_Ends") -> tuple[NDArray[Any], Any, Any]:
        """Returns rewards (T, N), with the values of the last states of truncated episodes added;
        values (T + 1, N); and log-probabilities (T, N) by torch, to compare with the update's own.
        """
        steps, count = rollout.rewards.shape
        rewards = rollout.rewards.copy()
        with torch.no_grad():
            values = self._values(rollout.observations).reshape(steps + 1, count)
            seen = self._tensor(self._normalised(rollout.observations[:-1])).flatten(0, 1)
            acted = self._tensor(rollout.actions).flatten(0, 1)
            _, log_probabilities, _ = self.policy.evaluate_actions(seen, acted)
            cut, last = ends.cut_off
            if len(last):
                rewards[cut] += self.gamma * self._values(last).numpy()
        return rewards, values, log_probabilities.reshape(steps, count)

    def _values(self, observations: NDArray[Any]) -> torch.Tensor:
        """Computes the values of the states (..., M), as (n,)."""
        seen = self._tensor(self._normalised(observations))
        values: torch.Tensor = self.policy.predict_values(seen.flatten(0, -2)).flatten().cpu()
        return values

    def _tensor(self, array: NDArray[Any]) -> torch.Tensor:
        return torch.as_tensor(np.array(array), dtype=torch.float32, device=self.device)


class _Ends:
    """The ends of the episodes of a rollout, as Stable-Baselines3 names what belongs to them."""

    def __init__(self, rollout: Rollout) -> None:
        ends = rollout.ends
        is_cut = ~rollout.terminated[ends.steps, ends.copies]
        #: index (steps, copies) and last observations of merely truncated episodes
        self.cut_off = (ends.steps[is_cut], ends.copies[is_cut]), ends.observations[is_cut]
        self._copies = rollout.rewards.shape[1]
        self._infos: dict[int, dict[int, Info]] = {}
        for i, step in enumerate(ends.steps.tolist()):
            info = {name: values[i] for name, values in ends.infos.items()}
            info["terminal_observation"] = ends.observations[i]
            info["TimeLimit.truncated"] = bool(is_cut[i])
            info["episode"] = {"r": float(ends.rewards[i]), "l": int(ends.lengths[i])}
            self._infos.setdefault(step, {})[int(ends.copies[i])] = info

    def infos(self, step: int) -> list[Info]:
        """Returns infos of all copies for Stable-Baselines3, with entries for ended episodes."""
        ended = self._infos.get(step, {})
        return [ended.get(copy, {}) for copy in range(self._copies)]
