"""Answers of `o80 view` to a page about robots and recordings."""

import base64
import math
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from processes import until

import o80
from o80.recording.joint_states import joints_of
from o80.view import foreign_model
from o80.view.answers import Answers
from o80.view.curves import STRETCHES, drawn_rows
from o80.view.scene import Scene
from o80.view.source_list import SourceList
from o80.view.urdf import Links
from o80.view.world import Drawn, Standing

Look = Callable[..., dict[str, Any]]
Floats = NDArray[np.float64]


def looks_at(*names: str, model_files: bool = False) -> Look:
    """Asks as a page does."""
    answers = Answers(SourceList(names, model_files=model_files), control=False)
    return lambda **requested: answers.look(requested)


def numbers(text: str) -> Any:
    return np.frombuffer(base64.b64decode(text), np.float32)


def pose_of(answer: dict[str, Any], kind: str = "pose") -> Any:
    return numbers(answer[kind]).reshape(-1, 7)


def turn_about_y(angle: float) -> list[float]:
    """Quaternion (w, x, y, z)."""
    return [math.cos(angle / 2), 0, math.sin(angle / 2), 0]


def test_a_page_learns_about_a_robot_once(arm: o80.Frontend) -> None:
    look = looks_at(arm.segment)
    answer = look()
    assert answer["source"] == arm.segment
    assert answer["new"]["panels"][:2] == ["shoulder", "elbow"]
    scene = answer["new"]["scene"]
    assert scene["moving"] == [1, 2]
    assert {geom["shape"] for geom in scene["geoms"]} == {"plane", "cylinder", "capsule"}
    assert "new" not in look(key=answer["key"])


def test_the_model_stands_as_the_row_says_and_the_ghost_as_desired(arm: o80.Frontend) -> None:
    arm.add_command(["shoulder", "elbow"], [0.5, -0.25], iterations=50)
    arm.burst(50)
    row = arm.latest()
    answer = looks_at(arm.segment)()
    shoulder, elbow = (float(angle) for angle in row.observed)
    pose = pose_of(answer)
    assert pose[0, 3:] == pytest.approx(turn_about_y(shoulder), abs=1e-6)
    assert pose[1, :3] == pytest.approx(
        [0.4 * math.sin(shoulder), 0, 0.3 + 0.4 * math.cos(shoulder)], abs=1e-6
    )
    assert pose[1, 3:] == pytest.approx(turn_about_y(shoulder + elbow), abs=1e-6)
    ghost = pose_of(answer, "ghost")
    assert ghost[0, 3:] == pytest.approx(turn_about_y(0.5), abs=1e-6)
    assert answer["values"]["shoulder"]["desired"] == 0.5


def test_a_page_looks_back_through_the_ring_while_the_robot_goes_on(arm: o80.Frontend) -> None:
    look = looks_at(arm.segment)
    arm.burst(1000)
    answer = look()
    back = arm.history()[500]
    seconds = answer["last"] - (arm.latest().time - back.time) * 1e-9
    arm.burst(100)
    answer = look(at=seconds)
    assert answer["iteration"] == back.iteration
    assert answer["last"] - answer["at"] == pytest.approx((arm.latest().time - back.time) * 1e-9)
    assert look()["iteration"] == arm.published


def test_a_row_that_was_overwritten_is_replaced_by_the_oldest(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, history=100) as arm:
        look = looks_at(segment)
        first = look()["first"]
        arm.burst(1000)
        answer = look(at=first)
        assert answer["overwritten"]
        assert answer["at"] == pytest.approx(answer["first"])
        assert answer["iteration"] >= arm.oldest


@pytest.mark.parametrize("seed", range(8))
def test_a_curve_is_that_of_all_rows_within_one_pixel(seed: int) -> None:
    random = np.random.default_rng(seed)
    values = random.choice([-1, 1]) * np.linspace(0, 1, int(random.integers(1, 30_000)))
    values += random.choice([0.0, 0.01, 1.0]) * random.standard_normal(len(values))
    drawn = drawn_rows(values)
    width = -(-len(values) // max(1, -(-len(values) // STRETCHES)))  # [pixels]
    places = np.arange(len(values)) * width / len(values)

    exact = covered(places, values, width)
    shown = covered(places[drawn], values[drawn], width)

    for one, other in ((exact, shown), (shown, exact)):
        low, high = widened(other)
        assert (one[0] >= low).all()
        assert (one[1] <= high).all()


def covered(places: Floats, values: Floats, width: int) -> tuple[Floats, Floats]:
    """Lowest and highest value (width,) of a polyline in each column of pixels."""
    at = np.union1d(places, np.linspace(0, width, 64 * width, endpoint=False))
    line = np.interp(at, places, values)
    columns = np.minimum(at.astype(int), width - 1)
    low, high = np.full(width, np.inf), np.full(width, -np.inf)
    np.minimum.at(low, columns, line)
    np.maximum.at(high, columns, line)
    return low, high


def widened(covered: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """By one column to both sides."""
    low, high = (np.pad(each, 1, "edge") for each in covered)
    return (
        np.min([low[:-2], low[1:-1], low[2:]], axis=0),
        np.max([high[:-2], high[1:-1], high[2:]], axis=0),
    )


def test_numbers_that_are_not_finite_are_named_and_leave_the_model_whole(segment: str) -> None:
    with o80.Backend(segment, actuators=["a", "b"]) as backend:
        backend.publish([0.0, 1.0])
        backend.step()
        backend.publish([math.nan, 1.0])
        answer = looks_at(segment)(curves=True, panels=["a", "b"])
        [_, values] = answer["curves"]["panels"]["a"]["observed"]
        assert np.isnan(numbers(values)).tolist() == [False, True]
        assert answer["values"]["a"]["observed"] == "nan"
        assert "names no model" in answer["new"]["no_scene"]


def test_sixty_four_actuators_are_offered_and_few_are_drawn_at_once(segment: str) -> None:
    with o80.Backend(segment, actuators=64) as backend:
        backend.publish(np.zeros(64))
        look = looks_at(segment)
        answer = look(curves=True)
        assert len(answer["new"]["panels"]) == 64
        assert len(answer["curves"]["panels"]) == 3
        everything = look(curves=True, panels=answer["new"]["panels"])
        assert len(everything["curves"]["panels"]) == 12


def test_no_segment_is_said_and_one_that_starts_later_is_shown(segment: str) -> None:
    named = looks_at(segment)()
    assert named["list"][0]["state"] == "waiting"
    assert segment in named["problem"]
    look = looks_at(segment + "*")
    answer = look()
    assert answer["list"] == []
    assert segment in answer["waiting"]
    with o80.robots.load("two_joints").inline(segment):
        assert wait_for(look, lambda answer: "at" in answer)["source"] == segment


def test_a_robot_that_dies_is_read_on_and_its_successor_is_shown_anew(segment: str) -> None:
    look = looks_at(segment)
    with o80.robots.load("two_joints").inline(segment) as arm:
        arm.burst(10)
        first = look()
    stopped = look(key=first["key"])
    assert stopped["list"][0]["state"] == "stopped"
    assert stopped["iteration"] == 10
    with o80.Backend(segment, actuators=["other"]) as backend:
        backend.publish([0.0])
        answer = wait_for(look, lambda answer: answer["key"] != first["key"], key=first["key"])
        assert answer["new"]["panels"] == ["other"]
        assert answer["iteration"] == 0


def wait_for(
    look: Look, ready: Callable[[dict[str, Any]], bool], **requested: Any
) -> dict[str, Any]:
    """Looks until the list of segments was read anew."""
    return until(lambda: answer if ready(answer := look(**requested)) else {})


def test_marks_stand_in_the_curves(segment: str, path: Path) -> None:
    live = looks_at(segment)
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, arm):
        arm.burst(100)
        arm.mark("pushed")
        arm.burst(200)
        seen = wait_for(live, lambda answer: "curves" in answer, curves=True)["curves"]
        assert seen["marks"] == [[pytest.approx(0.101), "pushed"]]
        arm.burst(2000)
        arm.mark("stopped")
        arm.burst(10)
        seen = live(curves=True, window=1.0)["curves"]
        assert seen["marks"] == [[pytest.approx(0.991), "stopped"]]
    recorded = looks_at(str(path))(curves=True, at=0.5, window=1.0)["curves"]
    assert recorded["marks"] == [[pytest.approx(0.101), "pushed"]]


def test_a_recording_is_shown_like_a_robot(recorded: Path, segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment):
        scene = looks_at(segment)()["new"]["scene"]
    look = looks_at(str(recorded))
    answer = look()
    history = o80.open(recorded)[segment].history()
    assert answer["source"] == segment
    assert not answer["live"]
    assert not answer["list"][0]["alive"]
    assert answer["iteration"] == 0
    assert look(key=answer["key"])["iteration"] == history.iteration[-1]
    assert answer["new"]["scene"] == scene
    for place in (0, 70, len(history) - 1):
        seconds = (history.time[place] - history.time[0]) * 1e-9
        answer = look(at=seconds, key=answer["key"])
        assert answer["iteration"] == history.iteration[place]
        angle = float(history.observed[place, 1])
        assert pose_of(answer)[1, 3:] == pytest.approx(turn_about_y(angle), abs=1e-6)


def test_segments_of_one_name_are_told_apart_by_their_file(
    recorded: Path, segment: str, tmp_path: Path
) -> None:
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(recorded.read_bytes())
    look = looks_at(str(recorded), str(copy), segment)
    names = [line["name"] for line in look()["list"]]
    assert names == [segment, f"{segment} of {recorded}", f"{segment} of {copy}"]
    assert look(source=names[2])["source"] == names[2]


def test_a_backend_in_python_names_a_model_and_what_moves_it(segment: str, tmp_path: Path) -> None:
    joint = "<joint name='{0}' axis='0 1 0' range='-90 90'/>"
    body = f"<body name='{{0}}'>{joint}<geom size='0.1'/></body>"
    model = tmp_path / "arm.xml"
    bodies = "".join(body.format(name) for name in ("shoulder", "wrist"))
    model.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    for given in (model, str(model), model.read_text()):
        with o80.Backend(
            segment,
            ["turn"],
            {"share": float},
            units={"share": "1"},
            limits={"turn": (0.5, 0.5)},  # nothing to spread over the range of the joint
            extended={"angles": (np.float64, 3)},
            model=given,
            joints={"shoulder": "turn", "wrist": ("angles", 2)},
        ) as backend:
            backend.publish([(0.5,)], {"angles": [0, 0, -0.25]})
            pose = pose_of(looks_at(segment)())
        assert pose[0, 3:] == pytest.approx(turn_about_y(0.5), abs=1e-6)
        assert pose[1, 3:] == pytest.approx(turn_about_y(-0.25), abs=1e-6)


def test_a_place_for_a_body_that_does_not_float_is_left_out(arm: o80.Frontend) -> None:
    place = {"what": "position", "name": "lower", "from": "states", "offset": 0}
    what = Drawn(arm.model, {"file": "", "values": [place]}, True, Standing())
    assert Scene(arm.schema, what).poses(arm.latest())["pose"]


MODEL = "<mujoco><worldbody>{}</worldbody></mujoco>"
BASE = "<geom name='floor' type='plane' size='1 1 1'/><body name='base' pos='0 {} 1'>"
TABLE = BASE.format("0") + "<joint name='turn'/><geom size='0.1'/></body><geom size='1 1 1'/>"
TWIN = TABLE.replace("size='1 1 1'/>", "size='2 2 2'/>")
ELSEWHERE = TABLE.replace("0 0 1", "0 5 1")


@contextmanager
def robots(segment: str, *models: str) -> Iterator[list[o80.Backend]]:
    """Robots whose models are these, each with one row; "" is a sensor that sees a ball."""
    with ExitStack() as running:
        backends = []
        for number, model in enumerate(models):
            options: dict[str, Any] = {"model": MODEL.format(model), "joints": {"turn": "turn"}}
            if not model:
                options = {"extended": {"ball": {"position": (float, 3)}}}
                options["units"] = {"position": "m"}
            backend = o80.Backend(f"{segment}-{number}", ["turn"], **options)
            backends.append(running.enter_context(backend))
            backend.publish([0.1 * number], None if model else {"ball": {"position": [1, 2, 3]}})
        yield backends


def has_poses(*names: str) -> Callable[[dict[str, Any]], bool]:
    return lambda answer: all("pose" in answer["others"].get(name, {}) for name in names)


def test_robots_that_have_a_thing_at_one_place_stand_in_one_scene(segment: str) -> None:
    with robots(segment, TABLE, TWIN, ELSEWHERE, "", TABLE) as backends:
        names = [f"{segment}-{number}" for number in range(5)]
        look = looks_at(*names)
        of_others = wait_for(look, has_poses(names[1], names[3]))["others"]
        shares = {name: each["shares"] for name, each in of_others.items()}
        assert shares == dict(zip(names[1:], (True, False, True, False), strict=True))
        assert "pose" not in of_others[names[2]]
        assert pose_of(of_others[names[1]])[0, 3:] == pytest.approx(
            [math.cos(0.05), 0, 0, math.sin(0.05)]
        )
        assert pose_of(of_others[names[3]])[0, :3] == pytest.approx([1, 2, 3])
        assert len(of_others[names[1]]["scene"]["geoms"]) == 3
        # what the page has is not sent again; what the user wants is there
        known = {name: each["key"] for name, each in of_others.items()}
        seen = {names[1]: False, names[2]: True}
        of_others = wait_for(look, has_poses(names[2]), known=known, seen=seen)["others"]
        assert "pose" not in of_others[names[1]]
        assert "scene" not in of_others[names[3]]
        # a ball that is not seen is not drawn
        backends[3].step()
        backends[3].publish([0.0], {"ball": {"position": [math.nan] * 3}})
        assert np.isnan(pose_of(look()["others"][names[3]])).all()
        # another one is chosen: of the copies it is the one
        of_others = look(source=names[4])["others"]
        assert not of_others[names[0]]["shares"]
        assert of_others[names[1]]["shares"]
        # what no model stands for is seen in the world of the first
        assert look(source=names[3])["others"][names[0]]["shares"]


def test_in_simulated_time_marks_say_which_rows_belong_together(segment: str, path: Path) -> None:
    load = o80.robots.load("two_joints")
    names = [f"{segment}-{number}" for number in range(2)]
    with (
        load.inline(names[0]) as arm,
        load.inline(names[1]) as twin,
        o80.Recording(path, [arm, twin]) as recording,
    ):
        arm.burst(500)  # the twin stands
        recording.mark("begin")
        for robot in (arm, twin):
            robot.add_command("shoulder", 1.0, iterations=1000)
            robot.burst(1000)
        recording.mark("end")
        arm.burst(500)
        live = looks_at(*names)
        live()
    look, seen = looks_at(str(path)), {names[1]: True}  # a copy of the arm
    of_twin = o80.open(path)[names[1]].history().observed[:, 0]
    for at, row in ((0.3, 0), (0.7, 200), (1.2, 700), (1.8, 1000)):  # [s] of the arm
        twin_there = wait_for(look, has_poses(names[1]), at=at, seen=seen)["others"][names[1]]
        assert pose_of(twin_there)[0, 3:] == pytest.approx(turn_about_y(of_twin[row]), abs=1e-6)
    # live it is only known what belongs together now
    twin_there = wait_for(live, has_poses(names[1]), at=1.6, seen=seen)["others"][names[1]]
    assert pose_of(twin_there)[0, 3:] == pytest.approx(turn_about_y(of_twin[600]), abs=1e-6)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"model": "nowhere.xml"}, "path of an MJCF file"),
        ({"joints": {"a": "turn"}}, "without a model"),
        ({"model": "<mujoco/>", "joints": {"a": "trun"}}, "Did you mean"),
        ({"model": "<mujoco/>", "joints": {"a": ("angle", 0)}}, "no extended field 'angle'"),
        ({"model": "<mujoco/>", "joints": {"a": ("angles", 3)}}, "no double with index 3"),
    ],
)
def test_a_model_that_cannot_be_drawn_is_refused(
    options: dict[str, Any], text: str, segment: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        o80.Backend(segment, ["turn"], extended={"angles": (np.float64, 3)}, **options)


def test_the_plan_of_chunks_is_drawn_ahead_of_the_newest_row(arm: o80.Frontend) -> None:
    look = looks_at(arm.segment)
    arm.burst(100)
    look()
    rows = [[0.2, -0.1], [0.1, 0.3], [0.0, 0.5]]
    with arm.chunks(step=100) as plan:
        plan.send(rows)
        arm.burst(150)
        plan.send([[1.0, 1.0], [0.5, 0.5]], seen=arm.latest())
        arm.burst(30)
        curves = look(curves=True, panels=["elbow"], window=1.0)["curves"]
        seconds, values = (numbers(text) for text in curves["panels"]["elbow"]["planned"])
        newest = arm.latest().time * 1e-9
        arm.burst(200)
    assert curves["end"] > 0.27 + 0.15, "the chart reaches ahead of the newest row"
    gaps = np.flatnonzero(np.isnan(values))
    assert len(gaps) == 2, "two chunks"
    assert values[gaps - 1].tolist() == [0.5, 0.5]
    second = slice(gaps[0] + 1, gaps[1])
    history = arm.history()
    ahead = seconds[second] + curves["begin"] > newest - history.time[0] * 1e-9
    assert 20 < ahead.sum() < len(ahead)
    wanted = np.interp(
        seconds[second] + curves["begin"],
        (history.time - history.time[0]) * 1e-9,
        history.desired[:, 1],
    )
    np.testing.assert_allclose(values[second], wanted, atol=2e-3)


# --------------------------------------------------------------------------------------------- URDF


@pytest.mark.parametrize("robot", ["two_joints", "pam"])
def test_links_and_shapes_of_a_urdf_are_where_the_model_has_them(robot: str) -> None:
    """MuJoCo reads it; it wants masses, which drawings lack."""
    with o80.robots.load(robot).inline() as arm:
        targets = [0.7, -0.4] if robot == "two_joints" else [18_000, 8_000] * 4
        arm.add_command(None, targets, iterations=100)
        row = bytes(memoryview(arm.burst(300)))  # type: ignore[arg-type]
        links, joints = Links.of(arm, "arm"), joints_of(arm._layout)
        assert links is not None
        assert joints is not None
        places = [number.offset for number in joints.numbers["position"]]
        names = dict(zip(places, joints.names, strict=True))
        keep = '><mujoco><compiler discardvisual="false"/></mujoco>'
        drawn = mujoco.MjSpec.from_string(links.urdf(arm.schema, names).replace(">", keep, 1))
        for body in drawn.bodies[1:]:
            body.mass, body.inertia, body.explicitinertial = 1.0, [1.0] * 3, True
        model = drawn.compile()
        data = mujoco.MjData(model)
        for place, name in names.items():
            data.joint(name).qpos = np.frombuffer(row, "f8", 1, place)[0]
        mujoco.mj_kinematics(model, data)
        found = [*links.places(row)]
        assert len(found) == model.nbody - 1
        for link, position, (*turn, real) in found:
            assert np.allclose(data.body(link).xpos, position, atol=1e-6), link
            assert np.allclose(data.body(link).xquat, [real, *turn], atol=1e-6), link
        whole = mujoco.MjModel.from_xml_string(arm.model)
        wanted = mujoco.MjData(whole)
        wanted.qpos[:] = data.qpos
        mujoco.mj_kinematics(whole, wanted)
        shapes = whole.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
        assert np.allclose(data.geom_xpos, wanted.geom_xpos[shapes], atol=1e-6)
        along, wanted_along = data.geom_xmat[:, 2::3], wanted.geom_xmat[shapes, 2::3]
        assert np.allclose(np.abs((along * wanted_along).sum(axis=1)), 1.0)


# ------------------- models of strangers: they read no file, do not hang and do not take all memory


PLAIN = """
<mujoco>
  <worldbody>
    <body name="arm"><joint name="elbow" axis="0 1 0"/><geom size="0.1 0.2" type="capsule"/></body>
  </worldbody>
</mujoco>
"""


def recording_with(model: str, folder: Path, segment: str) -> Path:
    """A recording of a robot that is drawn by this model."""
    path = folder / "stranger.mcap"
    with (
        o80.Backend(segment, ["elbow"], model=model, joints={"elbow": "elbow"}) as backend,
        o80.Recording(path, segment) as recording,
    ):
        backend.publish()
        backend.step()
        backend.publish()
        while recording.rows < 2:
            recording.flush()
    o80.clean(segment)
    return path


@pytest.mark.parametrize(
    "line",
    [
        '<include file="{file}"/>',
        '<asset><model name="a" file="{file}"/></asset>',
        '<asset><mesh name="a" file="/dev/zero.stl"/></asset>',
        '<asset><texture name="a" type="cube" fileup="/dev/zero"/></asset>',
        '<asset><hfield name="a" file="{pipe}" size="1 1 1 1"/></asset>',
    ],
)
def test_no_file_that_a_recording_names_is_read(line: str, segment: str, tmp_path: Path) -> None:
    file, pipe = tmp_path / "secret.xml", tmp_path / "pipe.png"
    file.write_text('<mujoco><worldbody><geom name="secret" size="1"/></worldbody></mujoco>')
    os.mkfifo(pipe)  # who opens it waits forever
    model = PLAIN.replace("<worldbody>", line.format(file=file, pipe=pipe) + "<worldbody>")
    path = recording_with(model, tmp_path, segment)
    new = looks_at(str(path))()["new"]
    assert new["scene"] is None
    assert "names a file" in new["no_scene"]
    assert "--model-files" in new["no_scene"]
    with o80.play(path, speed=float("inf")) as playback:
        playback.wait()
        assert "names a file" in looks_at(segment)()["new"]["no_scene"]


def test_the_user_may_allow_the_files_of_models(segment: str, tmp_path: Path) -> None:
    file = tmp_path / "floor.xml"
    file.write_text('<mujoco><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujoco>')
    model = PLAIN.replace("<worldbody>", f'<include file="{file}"/><worldbody>')
    path = recording_with(model, tmp_path, segment)
    shapes = {
        geom["shape"] for geom in looks_at(str(path), model_files=True)()["new"]["scene"]["geoms"]
    }
    assert shapes == {"plane", "capsule"}


@pytest.mark.parametrize(
    ("model", "why"),
    [
        ('<!DOCTYPE m [<!ENTITY a "b">]><mujoco/>', "document type"),
        ("<mujoco>" + "<a>" * 5000 + "</a>" * 5000 + "</mujoco>", "nested more than"),
        ("<mujoco><worldbody>", "no element found"),
        ("<mujoco><nonsense/></mujoco>", "nonsense"),
        (
            '<mujoco><asset><texture name="a" type="2d" builtin="flat" width="200000" '
            'height="200000"/></asset></mujoco>',
            "",
        ),
        ('<mujoco><size memory="900G"/></mujoco>', "memory"),
    ],
)
def test_hostile_models_are_told_and_the_rest_is_shown(
    model: str, why: str, segment: str, tmp_path: Path
) -> None:
    path = recording_with(model, tmp_path, segment)
    new = looks_at(str(path))()["new"]
    assert new["scene"] is None
    assert "cannot be read" in new["no_scene"]
    assert why in new["no_scene"]
    assert new["panels"] == ["elbow"]


def test_a_model_that_takes_forever_is_given_up(
    segment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foreign_model, "TIMEOUT", 2.0)
    line = '<replicate count="1000000" euler="0 0 1"><geom size="1"/></replicate>'
    model = PLAIN.replace("</worldbody>", f"{line}</worldbody>")
    path = recording_with(model, tmp_path, segment)
    assert "not compiled within 2 s" in looks_at(str(path))()["new"]["no_scene"]
