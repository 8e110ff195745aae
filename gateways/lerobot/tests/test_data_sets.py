"""Data sets of o80 as LeRobot reads them; its own SO-101 driver writes the same numbers."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch
from lerobot.configs.types import FeatureType
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.utils import dataset_to_policy_features, hw_to_dataset_features
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors
from lerobot.robots.so_follower import SO101Follower, SO101FollowerConfig
from pages import programs
from starting import Start

import o80
from o80.datasets import lerobot
from o80.datasets.episodes import episodes_of
from o80.datasets.lerobot_numbers import Units
from o80_arms import fakes

pytestmark = pytest.mark.check

NUMBERS = ("action", "observation.state")
PLACES = (2100, 1800, 2600, 1500, 900, 2500)


@pytest.fixture(scope="module")
def fake() -> Iterator[fakes.FakeArm]:
    with fakes.so101(tick=1 / 150) as fake:
        for servo, place in zip(fake.chain.servos.values(), PLACES, strict=True):
            servo.stand_at(place)
        yield fake


@pytest.fixture(scope="module")
def exported(fake: fakes.FakeArm, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of the arm, of 20 steps, each at 30 Hz."""
    folder = tmp_path_factory.mktemp("exported")
    with (
        o80.robots.load("so101").inline(**fake.options) as arm,
        o80.Recording(folder / "run.mcap", arm) as recording,
    ):
        here = arm.latest().observed.joints[4]
        for place in (here + 0.2, here):
            recording.mark("episode: turn the wrist")
            arm.add_command("wrist_roll", place, duration=0.5)
            for _ in range(20):
                arm.burst(5, seen=arm.latest())
            recording.mark("episode_end", reward=1.0)
    found = episodes_of(o80.open(folder / "run.mcap"), every=5)
    lerobot.write(folder / "set", found, sensors=["observed"])
    return folder / "set"


@pytest.mark.parametrize("units", ["degrees", "normalised"])  # the first is the default
def test_they_have_names_units_and_numbers_of_lerobots_own_driver(
    fake: fakes.FakeArm, exported: Path, tmp_path: Path, units: Units
) -> None:
    if units != "degrees":
        found = episodes_of(o80.open(exported.parent / "run.mcap"), every=5)
        exported = tmp_path / "ours"
        lerobot.write(exported, found, units=units)
    config = SO101FollowerConfig(
        port=str(fake.chain.port),
        id="fake",
        calibration_dir=fake.file.parent,
        use_degrees=units == "degrees",
    )
    robot = SO101Follower(config)
    ports = robot.bus.port_handler
    ports.isPacketTimeout = lambda: ports.getTimeSinceStart() > 60_000  # a busy machine
    robot.connect(calibrate=False)
    features = {
        **hw_to_dataset_features(robot.action_features, "action"),
        **hw_to_dataset_features(robot.observation_features, "observation"),
    }
    theirs = LeRobotDataset.create("o80/theirs", 30, features, root=tmp_path / "theirs")
    for _ in range(3):
        numbers = np.array([*robot.get_observation().values()], np.float32)
        theirs.add_frame({**dict.fromkeys(NUMBERS, numbers), "task": "stand"})
    theirs.save_episode()
    theirs.finalize()
    robot.disconnect()

    ours = LeRobotDataset("o80/ours", root=exported)
    theirs = LeRobotDataset("o80/theirs", root=tmp_path / "theirs")
    assert ours.fps == theirs.fps == 30
    for name in NUMBERS:
        assert ours.features[name] == theirs.features[name]
    last, first = ours[len(ours) - 1], theirs[0]
    assert last["observation.state"].numpy() == pytest.approx(
        first["observation.state"].numpy(), abs=0.2
    )
    if units != "degrees":
        return
    middles = np.array([(795 + 3300) / 2, (910 + 3185) / 2, (944 + 3151) / 2])
    assert ours[0]["observation.state"].numpy()[:3] == pytest.approx(
        (np.array(PLACES[:3]) - middles) * 360 / 4095, abs=0.1
    )


def test_lerobot_loads_iterates_and_takes_only_state_and_action_for_a_policy(
    exported: Path,
) -> None:
    window = {"action": [i / 30 for i in range(4)]}
    read = LeRobotDataset("o80/ours", root=exported, delta_timestamps=window)
    assert (read.num_episodes, len(read), read[0]["task"]) == (2, 40, "turn the wrist")
    batches = list(torch.utils.data.DataLoader(read, batch_size=8))
    assert [batch["action"].shape for batch in batches] == [(8, 4, 6)] * 5
    assert all(torch.isfinite(batch["complementary_info.age"]).all() for batch in batches)
    delays = [float(frame["complementary_info.delay"]) for frame in read.hf_dataset]
    assert max(delays) > 0
    for name, statistics in read.meta.stats.items():
        for value in statistics.values():
            assert np.isfinite(value).all(), name
    policy = dataset_to_policy_features(read.features)
    assert {name: each.type for name, each in policy.items()} == {
        "action": FeatureType.ACTION,
        "observation.state": FeatureType.STATE,
        "observation.environment_state": FeatureType.ENV,
    }


def test_a_policy_of_lerobot_learns_from_one_and_plays_the_arm(
    exported: Path, start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = {"action": [i / 30 for i in range(8)]}
    read = LeRobotDataset("o80/ours", root=exported, delta_timestamps=window)
    features = dataset_to_policy_features(read.features)
    torch.manual_seed(1)
    config = ACTConfig(
        input_features={k: v for k, v in features.items() if k != "action"},
        output_features={"action": features["action"]},
        chunk_size=8,
        n_action_steps=8,
        device="cpu",
        dim_model=32,
        n_heads=2,
        dim_feedforward=64,
    )
    policy = ACTPolicy(config)
    before, after = make_pre_post_processors(config, dataset_stats=read.meta.stats)
    batch = before(next(iter(torch.utils.data.DataLoader(read, batch_size=40))))
    optimizer = torch.optim.Adam(policy.parameters(), 1e-3)
    losses = []
    for _ in range(20):
        loss, _ = policy.forward(batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss))
    assert losses[-1] < losses[0]

    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "trained/checkpoints/last/pretrained_model"
    for part in (policy, before, after):
        part.save_pretrained(folder)
    segment = start("so101_twin")
    program = programs("lerobot.md")[0]
    for there, here in (('"so101"', repr(segment)), ("range(20)", "range(3)")):
        assert there in program
        program = program.replace(there, here)
    exec(compile(program, "lerobot.md", "exec"), {})
    with o80.Frontend(segment, read_only=True) as arm:
        entries = [each for each in arm.journal() if each.kind == "taken"]
        answers = [c for entry in entries for c in entry.commands if c.pace == "chunk"]
        assert [len(each.due) for each in answers] == [8, 8, 8]
        assert arm.halted is None
