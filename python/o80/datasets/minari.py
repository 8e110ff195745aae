"""Writes episodes as a Minari data set, by means of Minari itself."""

from pathlib import Path

import numpy as np

from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.base.finite import Say, say_not_finite, warn
from o80.datasets.episodes import Episode, Episodes


def write(path: Path, episodes: Episodes, say: Say = warn) -> None:
    """Writes a folder, which must not exist: `minari.MinariDataset(path / "data")` reads it.

    An observation is the observed numbers, then the sensor values; an action the desired numbers.
    Raises InvalidArgument for an existing folder, MissingExtra, OSError.
    """
    minari = needed("minari", "minari", "a Minari data set")
    needed("h5py", "minari", "a Minari data set")
    from gymnasium.spaces import Box
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_storage import MinariStorage

    if path.exists():
        raise InvalidArgument(f"{path} exists: give a new folder for the data set")
    size = len(episodes.names["observed"]) + len(episodes.names["extended"])
    actions = len(episodes.names["desired"])
    data = path.absolute() / "data"  # Minari would create a relative path twice
    data.mkdir(parents=True)
    storage = MinariStorage.new(
        data,
        observation_space=Box(-np.inf, np.inf, (size,), np.float64),
        action_space=Box(-np.inf, np.inf, (actions,), np.float64),
        data_format="hdf5",
    )
    names = episodes.names
    wrong = sum((~np.isfinite(each.observations)).sum(axis=0) for each in episodes.all)
    numbers = [*names["observed"], *names["extended"]]
    say_not_finite(dict(zip(numbers, wrong.tolist(), strict=True)), "in the observations", say)
    storage.update_metadata(
        {
            "dataset_id": f"o80/{episodes.robot}/{path.name}-v0",
            "minari_version": minari.__version__,
            "description": f"Recorded by o80 from '{episodes.segment}', {episodes.frequency:g} "
            f"steps a second. Observations: {', '.join([*names['observed'], *names['extended']])}. "
            f"Actions: {', '.join(names['desired'])}.",
        }
    )
    storage.update_episodes(
        [_buffer(each, number, EpisodeBuffer) for number, each in enumerate(episodes.all)]
    )


def _buffer(episode: Episode, number: int, kind: type) -> object:
    steps = len(episode)
    last = np.arange(steps) == steps - 1
    return kind(
        id=number,
        observations=episode.observations,
        actions=episode.actions,
        rewards=episode.rewards,
        terminations=last & episode.terminated,
        truncations=last & (not episode.terminated),
        infos={},
    )
