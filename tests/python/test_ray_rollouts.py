"""Rollouts of actors in Ray's own cluster of several machines, all of which are this one."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from ray_cluster import NODE, ray_cluster
from rollout_ppo import learned
from rollout_tasks import INFOS, assert_same_rollouts, maker, policies

import o80
from o80.learning.rollouts import LocalWorkers, RayWorkers, Replacement, Rollout

pytestmark = [pytest.mark.check, pytest.mark.timeout(900)]

STEPS = 25
WORKERS = 2


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    pytest.importorskip("ray")
    with ray_cluster() as started:
        yield started


def ray_workers(folder: Path, **options: Any) -> RayWorkers:
    return RayWorkers(maker(folder), workers=WORKERS, seed=5, infos=INFOS, **options)


def local_rollouts(folder: Path, replacements: Sequence[Replacement]) -> list[list[Rollout]]:
    """What workers in this process collect that are replaced in the same iterations."""
    with LocalWorkers(maker(folder), workers=WORKERS, seed=5, infos=INFOS) as workers:
        rollouts = []
        for policy in policies(4):
            for iteration, worker in replacements:
                if iteration == workers.iteration:
                    workers.replace(worker)
            rollouts.append(workers.collect(policy, steps=STEPS))
        return rollouts


def test_rollouts_are_those_of_local_workers_bit_for_bit(cluster: Any, tmp_path: Path) -> None:
    expected = local_rollouts(tmp_path, [])
    with ray_workers(tmp_path) as workers:
        processes = {each.process for each in workers.about}
        assert len(processes) == WORKERS
        assert os.getpid() not in processes
        for policy, local in zip(policies(4), expected, strict=True):
            assert_same_rollouts(workers.collect(policy, steps=STEPS), local)
        assert not workers.replacements


def test_ppo_learns_the_same_from_actors_and_from_local_workers(
    cluster: Any, tmp_path: Path
) -> None:
    local = LocalWorkers(maker(tmp_path), workers=WORKERS, seed=5, infos=INFOS)
    assert learned(ray_workers(tmp_path), STEPS, 3) == learned(local, STEPS, 3)


def test_killed_actors_are_replaced_and_the_training_goes_on(cluster: Any, tmp_path: Path) -> None:
    import ray

    given = policies(4)
    with ray_workers(tmp_path) as workers:
        rollouts = [workers.collect(given[0], steps=STEPS)]
        os.kill(workers.about[1].process, signal.SIGKILL)
        rollouts.append(workers.collect(given[1], steps=STEPS))
        (tmp_path / "die").touch()  # one of them, in the midst of its rollout
        rollouts.append(workers.collect(given[2], steps=STEPS))
        assert not list(tmp_path.iterdir())
        ray.kill(workers._actors[0])
        rollouts.append(workers.collect(given[3], steps=STEPS))
        replacements = workers.replacements
    assert [each.iteration for each in replacements] == [1, 2, 3]
    assert (replacements[0].worker, replacements[2].worker) == (1, 0)
    expected = local_rollouts(tmp_path, replacements)
    for some, others in zip(rollouts, expected, strict=True):
        assert_same_rollouts(some, others)


def test_exceptions_of_an_environment_are_raised_as_they_are(cluster: Any, tmp_path: Path) -> None:
    given = policies(4)
    with ray_workers(tmp_path) as workers:
        workers.collect(given[0], steps=STEPS)
        (tmp_path / "raise").touch()
        with pytest.raises(ArithmeticError, match="the ball is square") as raised:
            workers.collect(given[1], steps=STEPS)
        assert raised.value.__notes__[0].startswith("raised in rollout worker ")
        rollouts = workers.collect(given[1], steps=STEPS)
        replacements = workers.replacements
    assert [each.iteration for each in replacements] == [1, 1]
    assert_same_rollouts(rollouts, local_rollouts(tmp_path, replacements)[1])


def test_an_actor_that_always_dies_is_given_up(cluster: Any, tmp_path: Path) -> None:
    def deadly() -> Any:
        os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(o80.Error, match="worker 0 was replaced 3 times in iteration 0 and died"):
        RayWorkers(deadly, workers=1)


def test_mistakes_are_named(cluster: Any, tmp_path: Path) -> None:
    with pytest.raises(o80.TimeoutError, match=r"have not begun: .* reserve 7 proc.* Ray has 2"):
        RayWorkers(maker(tmp_path), workers=1, processors=7, timeout=0.5)
    with pytest.raises(o80.InvalidArgument, match="SameStep"):
        RayWorkers(lambda: __import__("gymnasium").make_vec("CartPole-v1"), workers=1)


def test_workers_of_a_machine_that_goes_begin_on_another(cluster: Any, tmp_path: Path) -> None:
    (going,) = cluster.worker_nodes
    given = policies(4)
    with ray_workers(tmp_path) as workers:
        rollouts = [workers.collect(given[0], steps=STEPS)]
        cluster.add_node(**NODE)
        cluster.remove_node(going, allow_graceful=False)
        rollouts += [workers.collect(policy, steps=STEPS) for policy in given[1:]]
        (replacement,) = workers.replacements
    expected = local_rollouts(tmp_path, [replacement])
    for some, others in zip(rollouts, expected, strict=True):
        assert_same_rollouts(some, others)
