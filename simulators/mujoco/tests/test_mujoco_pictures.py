"""Pictures of a model, from rows, without a screen; and of environments on it."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from processes import run_o80

import o80
from o80.learning import Environment, GroupTask, Outcome, VectorEnvironment

pytestmark = pytest.mark.check  # they need the extra `rendering`
PENDULUM = Path(__file__).parent / "models" / "pendulum.xml"
TWO = """<mujoco><worldbody><light pos="0 0 3"/><camera name="near" pos="0 -2 0.5" euler="80 0 0"/>
<camera name="far" pos="0 -6 0.5" euler="80 0 0"/><geom type="plane" size="2 2 1" rgba="1 1 1 1"/>
<body name="bar" pos="0 0 0.5"><camera name="hand" pos="0.6 0 0"/>
<joint name="turn" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.1" rgba="1 0 0 1"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "two.xml"
    path.write_text(TWO)
    return path


def test_a_picture_shows_the_row(model: Path) -> None:
    with o80.robots.load("mujoco").inline(model=model) as robot:
        robot.add_command("turn", {"position": -1.5}, iterations=100)
        robot.burst(100)
        with o80.Pictures(robot, size=(120, 80)) as pictures:
            first, last = (pictures.draw(row).astype(int) for row in robot.history()[::100])
    assert first.shape == (80, 120, 3)
    red = [(each[..., 0] - each[..., 1] > 60) for each in (first, last)]
    heights, widths = zip(*(np.nonzero(each) for each in red), strict=True)
    assert np.ptp(widths[0]) > 1.5 * np.ptp(heights[0]), "the bar lies"
    assert np.ptp(heights[1]) > 1.5 * np.ptp(widths[1]), "the bar stands"


def test_cameras_and_sizes(model: Path) -> None:
    with o80.robots.load("mujoco").inline(model=model) as robot:
        row = robot.latest()
        shown = {}
        for camera in ("hand", "near", "far", 0, None, -1):
            with o80.Pictures(robot, size=(900, 700), camera=camera) as pictures:
                shown[camera] = pictures.draw(row)
        assert shown["near"].shape == (700, 900, 3)
        assert (shown[0] == shown["near"]).all()
        assert (shown[None] == shown["near"]).all()
        assert (shown["far"] != shown["near"]).any()
        assert (shown[-1] != shown["near"]).any()
        with pytest.raises(o80.InvalidArgument, match=r"no camera 'top'; it has: near, far, hand"):
            o80.Pictures(robot, camera="top")
        with pytest.raises(o80.InvalidArgument, match="were closed"):
            pictures.draw(row)


def test_a_recording_has_the_same_pictures(model: Path, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with o80.robots.load("mujoco").inline(model=model) as robot:
        with o80.Recording(path, robot):
            robot.add_command("turn", {"position": -1.0}, iterations=10)
            robot.burst(10)
        with o80.Pictures(robot) as pictures:
            live = pictures.draw(robot.latest())
    (run,) = o80.open(path)[robot.segment].epochs
    with o80.Pictures(run) as pictures:
        assert (pictures.draw(run.history()[-1]) == live).all()


def test_a_robot_without_a_model_is_refused() -> None:
    segment = f"pictures-{os.getpid()}"
    with o80.Backend(segment, ["turn"]) as backend:
        backend.publish([0.0])
        with o80.Frontend(segment) as robot, pytest.raises(o80.InvalidArgument, match="no model"):
            o80.Pictures(robot)


class Swing(GroupTask):
    """Nothing to learn: the pendulum goes where it is told."""

    def __init__(self, copies: int, path: Path) -> None:
        group = o80.robots.load("mujoco").inline(model=path, copies=copies)
        super().__init__(
            group,
            burst=group.prepared_burst(20),
            seen=group.gather(["observed"]),
            observation_space=spaces.Box(-9, 9, (2,)),
            action_space=spaces.Box(-2, 2, (1,)),
        )

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        self.group.request("reset", copies=copies)

    def targets(self, actions: Any) -> Any:
        targets = np.zeros((len(actions), 1, 1), self.burst.targets.dtype)
        targets["position"][:, 0] = actions
        return targets

    def judge(self, copies: Any) -> Outcome:
        return Outcome()


def test_an_environment_on_a_model_has_pictures(model: Path) -> None:
    with Environment(Swing(1, model), render_mode="rgb_array") as environment:
        assert environment.metadata["render_modes"] == ["rgb_array"]
        period = environment.task.group[0].period  # type: ignore[attr-defined]
        assert environment.metadata["render_fps"] == pytest.approx(1 / (20 * period))
        environment.reset(seed=1)
        before = environment.render()
        environment.step(np.array([1.2]))
        after = environment.render()
        assert before.shape == (360, 480, 3)
        assert (before != after).any()
    with VectorEnvironment(Swing(3, model), render_mode="rgb_array") as vector:
        vector.reset(seed=1)
        vector.step(np.array([[1.2], [0.0], [1.2]]))
        pictures = vector.render()
        assert pictures is not None
        assert (pictures[0] == after).all()
        assert (pictures[1] == before).all()
        assert (pictures[2] == after).all()


def test_a_film_is_written(model: Path, tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    with (
        o80.robots.load("mujoco").inline(model=model) as robot,
        o80.Pictures(robot, size=(160, 120)) as pictures,
    ):
        robot.add_command("turn", {"position": -1.0}, iterations=100)
        robot.burst(100)
        drawn = (pictures.draw(row) for row in robot.history()[::10])
        assert o80.write_film(path, drawn, frames_per_second=25) == 11
    assert path.stat().st_size > 1000


@pytest.mark.parametrize("suffix", ["mp4", "gif"])
def test_robots_of_a_recording_are_filmed_side_by_side(
    suffix: str, model: Path, tmp_path: Path
) -> None:
    file, path = tmp_path / "run.mcap", tmp_path / f"at 12:30 %d.{suffix}"
    library = o80.robots.load("mujoco")
    with library.inline("one", model=model) as one, library.inline("other", model=model) as other:
        with o80.Recording(file, [one, other]):
            for target in (1.0, -1.0):
                one.add_command("turn", {"position": target}, iterations=100)
                one.burst(100)
                other.burst(100)
        period = one.period
    done = run_o80("film", file, "-o", path.name, "--size", 160, 120, "--rate", 20, cwd=tmp_path)
    assert f"{path.name}: {int(np.ceil(199 * period * 20))} frames" in done.stdout
    reader: Any = pytest.importorskip("imageio_ffmpeg").read_frames(str(path))
    assert next(reader)["size"] == (320, 120)
    frames = [np.frombuffer(each, np.uint8).reshape(120, 320, 3) for each in reader]
    moved = np.abs(np.diff(np.array(frames, np.int16), axis=0)) > 60
    assert moved[..., :160, :].any()
    assert not moved[..., 160:, :].any()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("x.avi",), "a film is NAME.mp4 or NAME.gif"),
        (("nowhere/x.gif",), "there is no folder nowhere"),
        (("x.gif", "--size", 0, 100), "16 to 4096 pixels"),
        (("x.gif", "--speed", "nan"), "--speed must be"),
        (("x.gif", "--rate", 60), "at most 50 frames a second of a gif"),
        (("x.gif", "--from", 5), "give --from and --to within"),
        (("x.gif", "--segment", "third"), "there are: one, other"),
        (("x.gif",), "never ran at the same time"),
    ],
)
def test_a_film_that_cannot_be_is_refused(
    words: tuple[object, ...], message: str, model: Path, tmp_path: Path
) -> None:
    library, file = o80.robots.load("mujoco"), tmp_path / "run.mcap"
    for name in ("one", "other"):
        with (
            library.inline(name, model=model) as robot,
            o80.Recording(file, robot, proceed=name == "other"),
        ):
            robot.burst(9)
    done = run_o80("film", file, "-o", *words, code=1, cwd=tmp_path)
    assert message in done.stderr


def test_without_a_renderer_the_error_names_the_extra(model: Path) -> None:
    program = f"""
import sys, o80
sys.modules["OpenGL"] = None
with o80.robots.load("mujoco").inline(model={str(model)!r}) as robot:
    try:
        o80.Pictures(robot)
    except o80.MissingExtra as error:
        print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.strip().endswith('pip install "o80[rendering]"'), done.stderr
