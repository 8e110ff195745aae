"""A driver class in Python is a robot like any other."""

import hashlib
import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import room_sensor
from cart import written
from processes import WAIT, o80_says, run_python
from room_sensor import Joint, Paced, RoomSensor

import o80
from o80.drivers import Reading

HERE = Path(__file__).parents[1]


# ---------------------------------------------------------------------- options


def test_every_option_reaches_the_driver_and_the_provenance(segment: str) -> None:
    given: dict[str, tuple[Any, str]] = {
        "mean": (2.0, "2.0"),
        "times": (3, "3"),
        "loud": (True, "true"),
        "port": ("usb", "usb"),
        "folder": ("there", "there"),
        "colour": ("BLUE", "BLUE"),
        "mode": ("fast", "fast"),
        "gains": ([0.25, 0.5], "0.25,0.5"),
        "offsets": ((4, 5, 6), "4,5,6"),
        "seed": (7, "7"),
    }
    options = {name: value for name, (value, _) in given.items()}
    with o80.robots.load(RoomSensor).inline(segment, **options) as room:
        assert room.latest().extended.temperature == 6.75
        assert room.latest().extended.seed == 7
        told = room.provenance
    assert told.options == {name: text for name, (_, text) in given.items()}
    assert told.robot == "room"
    assert told.library == f"{Path(room_sensor.__file__).resolve()}:RoomSensor"
    file = Path(room_sensor.__file__).read_bytes()
    assert told.library_sha256 == hashlib.sha256(file).hexdigest()
    assert (told.version, told.run_options["bursting"]) == (o80.version(), "true")


def test_options_are_listed_like_those_of_any_robot() -> None:
    options = {each.name: each for each in o80.robots.load("room_sensor:RoomSensor").options}
    assert options["mean"].help == "of the room"
    assert options["mean"].unit == "C"
    assert options["mean"].default == "21.0"
    assert [each.kind for each in options.values()] == [
        "number",
        "integer",
        "boolean",
        "text",
        "text",
        "one of: RED, BLUE",
        "one of: fast, slow",
        "2 x number",
        "3 x integer",
        "seed",
    ]
    said = o80_says("run", "room_sensor:RoomSensor", "--help", cwd=HERE)
    assert "--mean number" in said
    assert "of the room [C] (default: 21.0)" in said
    assert "--frequency" in said


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"maen": 1.0}, "has no option 'maen'. Did you mean 'mean'"),
        ({"mean": "warm"}, "must be a number"),
        ({"times": 1.5}, "option 'times' must be an integer, got '1.5'"),
        ({"loud": "maybe"}, "option 'loud' must be a boolean"),
        ({"colour": "GREEN"}, "option 'colour' must be one of: RED, BLUE"),
        ({"mode": "medium"}, "option 'mode' must be one of: fast, slow"),
        ({"gains": [1.0]}, "option 'gains' must be 2 x number"),
        ({"seed": -1}, "option 'seed' must be a whole number, at least 0"),
    ],
)
def test_wrong_options_are_named(given: dict[str, Any], text: str, segment: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        o80.robots.load(RoomSensor).inline(segment, **given)


# ---------------------------------------------------------------------- verbs


def test_requests_answer_like_those_of_a_driver_in_cpp(segment: str) -> None:
    with o80.robots.load(Joint).inline(segment) as joint:
        with pytest.raises(o80.RequestRejected, match="too far"):
            joint.request("home", place=2.0)
        joint.request("home", place=0.75)
        row = joint.latest()
        assert row.observed.tolist() == row.desired.tolist() == [0.75, 0.75]
        joint.add_request("calibrate")
        batch = joint.pulse()
        joint.burst(3)
        assert joint.running_requests[0].progress == "at 3"
        joint.burst(5)
        assert batch.statuses == [o80.Status.COMPLETED]
        assert joint.latest().observed.tolist() == [0.25, 0.25]


def test_a_halt_and_a_resume_are_told(segment: str) -> None:
    with o80.robots.load(Joint).inline(segment) as joint:
        joint.halt("enough")
        joint.burst(2)
        joint.resume()
        joint.burst(1)
        assert joint.latest().extended.halts == 1
        assert joint.latest().extended.resumes == 1
    with o80.robots.load(Joint).inline(segment, fails_in="refuse") as joint:
        joint.halt("enough")
        joint.burst(1)
        with pytest.raises(o80.Error, match="the bus is down"):
            joint.resume()


@pytest.mark.parametrize("verb", ["__init__", "start"])
def test_an_exception_before_the_first_row_tells_where_it_was_raised(
    verb: str, segment: str
) -> None:
    with pytest.raises(o80.DriverError, match=rf"broken {verb} \(.*room_sensor.py:\d+, in _may"):
        o80.robots.load(Joint).inline(segment, fails_in=verb)


@pytest.mark.parametrize("verb", ["write", "read", "on_home", "halt", "resume"])
def test_an_exception_of_a_verb_ends_the_robot_as_failed(verb: str, segment: str) -> None:
    with o80.robots.load(Joint).inline(segment, fails_in=verb) as joint:

        def use() -> None:
            joint.burst(5)
            if verb in ("halt", "resume"):
                joint.halt("enough")
                joint.burst(1)
                joint.resume()
            joint.request("home", place=0.0)

        with pytest.raises(o80.Error, match=f"RuntimeError: broken {verb}"):
            use()
        with pytest.raises(o80.BackendFailed, match=f"broken {verb}"):
            joint.burst(1)


@pytest.mark.parametrize("value", [False, "the bus is down"])
@pytest.mark.parametrize("verb", ["start", "write", "read", "halt", "resume", "on_home", "stop"])
def test_a_verb_that_returns_something_is_named_with_it(
    segment: str, capfd: pytest.CaptureFixture[str], verb: str, value: object
) -> None:
    def returns(self: Joint, *arguments: object) -> object:
        getattr(Joint, verb)(self, *arguments)
        return value

    def use() -> None:
        with o80.robots.load(driver).inline(segment) as joint:
            joint.burst(1)
            joint.halt("enough")
            joint.burst(1)
            joint.resume()
            joint.request("home", place=0.0)

    driver = type("Joint", (Joint,), {verb: returns})
    text = rf"{verb}(\(\))? must return None.*got {value!r}"
    if verb == "stop":
        use()
        assert re.search(text, capfd.readouterr().err)
        return
    with pytest.raises(o80.Error, match=rf"'joint' .*{text}"):
        use()


@pytest.mark.parametrize(
    ("report", "text"),
    [
        (lambda it: it.fault(5), "reason of reading.fault must be a string, got 5"),
        (lambda it: it.progress("home", 5), "reading.progress must be a string, got 5"),
        (lambda it: it.ended("home", False), "answer must be None or o80.StartAfresh.*got False"),
        (lambda it: it.ended("home", rejected=5), "rejected must be a string, got 5"),
        (lambda it: o80.Running(cast(str, 5)), "progress of o80.Running must be a string, got 5"),
    ],
)
def test_a_report_of_another_type_says_what_it_wants(
    segment: str, report: Callable[[Any], object], text: str
) -> None:
    def read(self: Joint, reading: Reading) -> None:
        report(reading)

    driver = type("Joint", (Joint,), {"read": read})
    with pytest.raises(o80.DriverError, match=f"'joint' failed in read: .*{text}"):
        o80.robots.load(driver).inline(segment)


def test_a_reading_halts_also_with_what_is_no_text(segment: str) -> None:
    def read(self: Joint, reading: Reading) -> None:
        Joint.read(self, reading)
        if reading.iteration > 0:
            reading.halt(cast(str, OSError("hot")))

    with o80.robots.load(type("Joint", (Joint,), {"read": read})).inline(segment) as joint:
        with (
            pytest.warns(RuntimeWarning, match="reading.halt must be a string, got hot"),
            pytest.raises(o80.BackendHalted),
        ):
            joint.burst(5)
        assert joint.halted
        assert joint.halted.text == "hot"


def test_what_a_reading_reports_reaches_the_loop(segment: str) -> None:
    def start(fails_in: str) -> o80.Frontend:
        return o80.robots.load(Joint).inline(segment, fails_in=fails_in)

    with start("fault") as joint, pytest.raises(o80.DriverError, match="the bus is gone"):
        joint.burst(5)
    with start("halting") as joint:
        with pytest.raises(o80.BackendHalted):
            joint.burst(5)
        assert joint.halted
        assert joint.halted.text == "too hot"
    with start("finish") as joint, pytest.raises(o80.BackendStopped):
        joint.burst(10)
    with start("interrupt") as joint:
        joint.add_command(["elbow"], [0.5], iterations=10)
        batch = joint.pulse()
        joint.burst(5)
        assert batch.statuses == [o80.Status.INTERRUPTED]
    with start("unknown") as joint, pytest.raises(o80.DriverError, match="no actuator 'wrist'"):
        joint.burst(5)


def test_texts_without_utf_8_are_shown_and_end_nothing(segment: str) -> None:
    """A lone surrogate, as in a file name that Python could not decode."""

    def refuse(self: Joint, fields: object) -> None:
        raise o80.RequestRejected("no \ud800")

    def begin(self: Joint, fields: object) -> o80.Running:
        self.homing = 0
        return o80.Running("begins \ud800")

    def read(self: Joint, reading: Reading) -> None:
        Joint.read(self, reading)
        if self.homing > 0:
            reading.progress("calibrate", "at \ud800")
        if self.homing > 1:
            reading.halt("hot \ud800")

    def resume(self: Joint) -> None:
        refuse(self, None)

    verbs = {"on_home": refuse, "on_calibrate": begin, "resume": resume, "read": read}
    with o80.robots.load(type("Joint", (Joint,), verbs)).inline(segment) as joint:
        with pytest.raises(o80.RequestRejected, match=r"no \\ud800"):
            joint.request("home", place=0.0)
        joint.add_request("calibrate")
        batch = joint.pulse()
        joint.burst(1)
        assert batch[0].progress == "at \\ud800"
        joint.burst(1)
        assert joint.halted
        assert joint.halted.text == "hot \\ud800"
        with pytest.raises(o80.BackendHalted, match=r"no \\ud800"):
            joint.resume()
        assert joint.life == "running"


def test_an_exception_in_stop_is_printed_and_ends_nothing_else(
    segment: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with o80.robots.load(Joint).inline(segment, fails_in="stop") as joint:
        joint.burst(1)
    assert "broken stop" in capfd.readouterr().err


# ---------------------------------------------------------------------- a process


def test_a_process_serves_a_driver_in_python(segment: str) -> None:
    robot = o80.robots.load("room_sensor:Joint")
    with robot.start(segment, frequency=200, gain=1.0, gap=0) as process:
        joint = process.frontend(WAIT)
        joint.add_command("elbow", 0.5, iterations=10)
        joint.pulse_and_wait(WAIT)
        assert joint.latest().observed[1] == 0.5
        assert joint.robot == "joint"
    assert "stopped" in process.output
    assert process.wait() == 0


def test_an_exception_of_a_process_reaches_its_frontends(segment: str) -> None:
    with o80.robots.load(Joint).start(segment, bursting=True, fails_in="read") as process:
        with pytest.raises(o80.BackendFailed, match="RuntimeError: broken read"):
            process.frontend(WAIT).burst(10, timeout=WAIT)
        assert process.wait(WAIT) == 1
    with pytest.raises(o80.DriverError, match="broken start"):
        o80.robots.load(Joint).start(segment, fails_in="start")
    with pytest.raises(o80.InvalidArgument, match="must be a number"):
        o80.robots.load(Joint).start(segment, gain="much")


def test_a_driver_may_pace_the_loop_by_its_own_clock(segment: str) -> None:
    with o80.robots.load(Paced).start(segment, gap=0) as process:
        paced = process.frontend(WAIT)
        paced.wait_for(20, timeout=WAIT)
        assert paced.period == pytest.approx(1 / 250)
        assert paced.latest().extended.due > 0
    with pytest.raises(o80.DriverError, match="the driver runs at 250 Hz, but 100 Hz"):
        o80.robots.load(Paced).inline(segment, frequency=100)


SCRIPT = """
import os, o80
class Counter:
    extended = {{"count": int}}
    def read(self, reading): ...
open({started!r}, "a").write("x")
assert os.path.getsize({started!r}) < 4, "a chain of processes"
{guard}
    with o80.robots.load(Counter).start({name!r}) as process:
        print(process.frontend().robot)
"""


@pytest.mark.parametrize("guard", ['if __name__ == "__main__":', "if True:"])
def test_a_script_with_a_driver_of_its_own_needs_a_main_guard(
    segment: str, tmp_path: Path, guard: str
) -> None:
    script, started = tmp_path / "script.py", tmp_path / "started"
    script.write_text(SCRIPT.format(guard=guard, started=str(started), name=segment))
    done = run_python(script, code=None)
    assert started.read_text() == "xx"  # by the script and by the robot's process
    if guard == "if True:":
        assert done.returncode == 1
        assert "o80.errors.DriverError: the driver" in done.stderr
        assert f"{script} starts a robot when it is imported" in done.stderr
        assert 'put what the script does under `if __name__ == "__main__":`' in done.stderr
    else:
        assert done.stdout == "counter\n", done.stderr


# ---------------------------------------------------------------------- mistakes


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ("no_such_module:Driver", "cannot be imported: ModuleNotFoundError"),
        ("room_sensor:RoomSensr", "has no class 'RoomSensr'.*Did you mean 'RoomSensor'"),
        ("room_sensor:Colour", "Colour is not a driver: give it read"),
    ],
)
def test_a_class_that_is_no_driver_is_named(place: str, text: str) -> None:
    with pytest.raises(o80.DriverError, match=text):
        o80.robots.load(place)
    assert "o80: " in o80_says("run", place, code=1, cwd=HERE)


class Reads:
    def read(self, reading: Reading) -> None: ...


def made(**members: Any) -> type[Any]:
    return type("Wrong", (Reads,), members)


@dataclass
class NoDefault:
    port: str


@dataclass
class OddOption:
    table: dict[str, int] = None  # type: ignore[assignment]


@pytest.mark.parametrize(
    ("members", "text"),
    [
        ({"write": lambda self: None}, r"Wrong.write must be write\(self, desired\)"),
        ({"halt": lambda self, why: None}, r"Wrong.halt must be halt\(self\)"),
        ({"Config": int}, "Config must be a dataclass"),
        ({"Config": NoDefault}, "option 'port' has no default"),
        ({"Config": OddOption}, r"Config.table must be a float, an int"),
        ({"requests": {"home": None}}, r"the method on_home\(self, fields\)"),
        ({"actuators": ["a"], "limits": {"b": (0, 1)}}, "no actuator 'b'"),
        ({"frequency": -1}, "frequency must be a positive number"),
        *(
            ({"gap": gap}, r"gap must be from 0\.000001 to 3600 s, got")
            for gap in (0.0, float("nan"), 1e9, "long")
        ),
        ({"simulated": "no"}, "simulated must be True or False"),
        ({"extended": {"image": object}}, "must be a number of 1 to 8 bytes"),
    ],
)
def test_a_driver_that_is_wrong_is_refused_with_a_cure(
    members: dict[str, Any], text: str, segment: str
) -> None:
    with pytest.raises(o80.DriverError, match=text):
        o80.robots.load(made(**members)).inline(segment)


def test_a_recording_cannot_name_a_class_to_import(
    segment: str, path: Path, tmp_path: Path
) -> None:
    """It is replayed without its driver, or not at all."""
    snapshots = {name: {"slot": np.uint32} for name in ("snapshot", "restore")}
    members = {
        "simulated": True,
        "name": "joint",
        "requests": {"reset": {"seed": np.uint64}} | snapshots,
        **{f"on_{name}": lambda self, fields: None for name in ("reset", "snapshot", "restore")},
    }
    simulated = type("Simulated", (Reads,), members)
    for driver, file in ((Joint, "run.mcap"), (simulated, "simulated.mcap")):
        with (
            o80.robots.load(driver).inline(segment) as joint,
            o80.Recording(tmp_path / file, [segment]),
        ):
            joint.burst(5)
    by_readings = o80.replay(path)
    assert str(by_readings) == f"{segment}: 6 rows, no driver was started: desired states identical"
    assert any("the robot may be hardware" in note for note in by_readings.runs[0].notes)
    with pytest.raises(o80.DriverError, match="joint"):
        o80.replay(tmp_path / "simulated.mcap")


def test_a_simulation_in_python_is_replayed_from_its_segment(segment: str, tmp_path: Path) -> None:
    place = written(tmp_path, "replayed_cart")
    with o80.robots.load(place).inline(segment) as frontend:
        frontend.request("reset", seed=3)  # a number of Python, as random.Random wants it
        assert frontend.latest().observed[0] == random.Random(3).uniform(-1, 1)
        frontend.add_command("x", 1.0, iterations=10)
        frontend.burst(20)
        (run,) = o80.replay(frontend)
        assert run.identical
        assert not any("No driver was started" in note for note in run.notes)
        assert frontend.provenance.library == place
        # a process that has not loaded the class
        said = run_python("-c", f"import o80; print(o80.replay(o80.Frontend({segment!r})))")
        assert said.stdout == f"{segment}: 22 rows, identical\n"


# ---------------------------------------------------------------------- differences


class Follower:
    """Has its velocities summed, as a feed-forward would use them."""

    actuators = ("left", "right")
    dtype = {"angle": float, "on": bool}  # noqa: RUF012
    limits = {"left": {"angle": o80.Limits(speed=2.0, acceleration=15.0)}}  # noqa: RUF012
    frequency = 500.0
    gap = 0.02

    def __init__(self) -> None:
        self.sums = np.zeros(2)
        self.speeds = np.zeros(2)
        self.states = np.zeros(2, [("angle", float), ("on", bool)])

    def write(self, desired: Any) -> None:
        speeds = desired.rate("angle")
        self.sums += speeds * desired.period
        active = desired.active
        changes = (speeds - self.speeds) / desired.period
        np.testing.assert_allclose(desired.rate2("angle")[active], changes[active], atol=1e-6)
        np.testing.assert_allclose(self.sums, desired["angle"], atol=1e-12)
        assert not desired.rate("on").any()
        self.speeds = speeds
        self.states = desired[:].copy()

    def read(self, reading: Reading) -> None:
        reading.observed = self.states


def test_rates_of_desired_states_sum_to_the_states(segment: str) -> None:
    with o80.robots.load(Follower).inline(segment) as robot:
        assert robot.schema["gap"] == 0.02
        robot.add_command("left", {"angle": 0.3})
        robot.add_command("right", {"angle": 1.0, "on": True}, iterations=40)
        robot.burst(60)
        robot.add_command("left", {"angle": -0.1}, mode="overwrite")
        assert robot.burst(300).desired["angle"].tolist() == [-0.1, 1.0]


class Misnames(Follower):
    def write(self, desired: Any) -> None:
        desired.rate("angel")


class Late(Follower):
    desired: Any = None

    def write(self, desired: Any) -> None:
        self.desired = desired

    def read(self, reading: Reading) -> None:
        if self.desired is not None:
            self.desired.rate("angle")


@pytest.mark.parametrize(
    ("driver", "said"),
    [(Misnames, "no field 'angel'.*angle"), (Late, r"in write\(\) only")],
)
def test_rates_that_are_not_there_are_a_fault_that_says_so(
    segment: str, driver: type[Follower], said: str
) -> None:
    with pytest.raises(o80.Error, match=said), o80.robots.load(driver).inline(segment) as robot:
        robot.burst(1)
