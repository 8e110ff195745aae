"""Stable-Baselines3's PPO learns from the rollouts of a collector (o80.learning.rollouts.ppo)."""

import tempfile
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from learning_tasks import COPIES, INFOS, reaching
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import VecNormalize
from training_tasks import Guess

import o80
from o80.learning.rollouts import Collector, Rollout
from o80.learning.rollouts.ppo import CollectorEnv, RolloutPPO

pytestmark = pytest.mark.check  # needs torch, which only `make check` installs

STEPS = 32


def model_of(collector: Collector, *, steps: int, batch: int = 80) -> RolloutPPO:
    return RolloutPPO(
        "MlpPolicy",
        VecNormalize(CollectorEnv(collector), norm_reward=False),
        n_steps=steps,
        batch_size=batch,
        n_epochs=4,
        learning_rate=2e-3,
        seed=3,
        device="cpu",
    )


class Copied:
    """A model as it was before its last update."""

    def __init__(self, model: PPO) -> None:
        self.gamma, self.trace = model.gamma, model.gae_lambda
        self._policy, self._weights = model.policy, deepcopy(model.policy.state_dict())
        normalisation = model.get_vec_normalize_env()
        assert normalisation is not None
        self._statistics: Any = deepcopy(normalisation.obs_rms)
        self._epsilon = normalisation.epsilon

    def values(self, observations: Any) -> Any:
        """Predicts the values (...) of observations (..., M)."""
        statistics = self._statistics
        seen = (observations - statistics.mean) / np.sqrt(statistics.var + self._epsilon)
        tensor = torch.as_tensor(np.clip(seen, -10, 10), dtype=torch.float32)
        self._policy.load_state_dict(self._weights)  # the training is over
        with torch.no_grad():
            values = self._policy.predict_values(tensor.reshape(-1, tensor.shape[-1]))
        return values.numpy().reshape(np.shape(observations)[:-1])


class Told(BaseCallback):
    """Keeps the rollouts, the buffer of each update, and the ends of episodes."""

    def __init__(self, collector: Collector) -> None:
        super().__init__()
        self.rollouts: list[Rollout] = []
        self.ends: list[Any] = []
        self.buffers: list[Any] = []
        self.before: Any = None
        collect = collector.collect

        def kept(policy: Any, *, steps: int) -> Rollout:
            assert isinstance(self.model, PPO)
            self.before = Copied(self.model)
            self.rollouts.append(collect(policy, steps=steps))
            return self.rollouts[-1]

        collector.collect = kept  # type: ignore[method-assign]

    def _on_step(self) -> bool:
        for copy in np.flatnonzero(self.locals["dones"]):
            self.ends.append(self.locals["infos"][copy])
        return True

    def _on_rollout_end(self) -> None:
        assert isinstance(self.model, PPO)
        buffer = self.model.rollout_buffer
        names = ("observations", "actions", "log_probs", "values", "advantages", "returns")
        kept: dict[str, Any] = {name: getattr(buffer, name).copy() for name in names}
        self.buffers.append(kept | {"starts": buffer.episode_starts.copy()})


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def told() -> Iterator[Told]:
    """A training of three rollouts."""
    with Collector(reaching, seed=5, infos=INFOS) as collector:
        made = Told(collector)
        model_of(collector, steps=STEPS).learn(3 * STEPS * COPIES, callback=made)
        yield made


def test_log_probabilities_are_those_of_the_rollout_and_advantages_of_its_rewards(
    told: Told,
) -> None:
    assert len(told.buffers) == 3
    cut_off = 0
    for rollout, buffer in zip(told.rollouts, told.buffers, strict=True):
        assert buffer["log_probs"] == pytest.approx(rollout.log_probabilities, abs=1e-4)
        assert buffer["actions"].tobytes() == rollout.actions.tobytes()
        over = rollout.terminated | rollout.truncated
        assert buffer["starts"][1:].tolist() == over[:-1].astype(float).tolist()
        cut_off += int((rollout.truncated & ~rollout.terminated).sum())
    assert cut_off > 10

    # the last one by hand, with the model as it was then
    expected = advantages(told.before, told.rollouts[-1])
    assert told.buffers[-1]["advantages"] == pytest.approx(expected, abs=1e-3)


def advantages(model: Any, rollout: Rollout) -> Any:
    """Generalised advantage estimates (T, N)."""
    values = model.values(rollout.observations)
    final = {
        (step, copy): model.values(seen)
        for step, copy, seen in zip(
            rollout.ends.steps.tolist(),
            rollout.ends.copies.tolist(),
            rollout.ends.observations,
            strict=True,
        )
    }
    found = np.zeros_like(rollout.rewards)
    for copy in range(rollout.rewards.shape[1]):
        after = 0.0
        for step in reversed(range(len(found))):
            next_value = values[step + 1, copy]
            if rollout.terminated[step, copy]:
                next_value, after = 0.0, 0.0
            elif rollout.truncated[step, copy]:
                next_value, after = final[step, copy], 0.0
            error = rollout.rewards[step, copy] + model.gamma * next_value - values[step, copy]
            after = found[step, copy] = error + model.gamma * model.trace * after
    return found


def test_the_callback_hears_of_every_end(told: Told) -> None:
    ends = [each.ends for each in told.rollouts]
    for name in INFOS:
        expected = sorted(str(value) for each in ends for value in each.infos[name])
        assert sorted(str(info[name]) for info in told.ends) == expected
    paid = sorted(reward for each in ends for reward in each.rewards.tolist())
    assert sorted(info["episode"]["r"] for info in told.ends) == paid


def test_statistics_are_those_of_the_observations_of_all_rollouts(told: Told) -> None:
    normalisation = told.model.get_vec_normalize_env()
    assert normalisation is not None
    seen = [each.observations[:-1].reshape(-1, 6) for each in told.rollouts]
    statistics: Any = normalisation.obs_rms
    assert statistics.mean == pytest.approx(np.concatenate(seen).mean(axis=0), abs=1e-4)
    assert statistics.var == pytest.approx(np.concatenate(seen).var(axis=0), abs=1e-3)


def test_it_leaves_no_temporary_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def make() -> Any:
        return SyncVectorEnv([Guess] * 2, autoreset_mode=AutoresetMode.SAME_STEP)

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.delenv("SB3_LOGDIR", raising=False)
    with Collector(make, seed=1) as collector:
        model_of(collector, steps=8, batch=16).learn(16)
    assert not list(tmp_path.iterdir())


def test_mistakes_are_named() -> None:
    with Collector(reaching, seed=5, infos=INFOS) as collector:
        environments = CollectorEnv(collector)
        model = PPO("MlpPolicy", environments, n_steps=2, batch_size=2, device="cpu")
        model.set_logger(Logger(None, []))
        with pytest.raises(o80.InvalidArgument, match="give CollectorEnv to a RolloutPPO only"):
            model.learn(2)
        with pytest.raises(o80.InvalidArgument, match="norm_reward=False"):
            RolloutPPO("MlpPolicy", VecNormalize(environments), device="cpu")
        options: Any = {"activation_fn": torch.nn.ReLU}
        with pytest.raises(o80.InvalidArgument, match="layers of tanh"):
            RolloutPPO("MlpPolicy", environments, policy_kwargs=options, device="cpu")
