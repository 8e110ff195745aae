"""Robots: found, loaded, started as processes and inside this one."""

import ast
import importlib
import os
import tomllib
from pathlib import Path

import pytest
from processes import WAIT, may_use_fifo, run_python

import o80

ROOT = Path(__file__).resolve().parents[3]


def test_robots_that_are_shipped_say_that_they_are_simulated_or_are_hardware() -> None:
    hardware = {"so101", "so101_leader", "koch", "koch_leader"} | {
        "ball_launcher/driver", "ball_tracking/ball_tracker", "ball_tracking/tracking_server",
        "cameras/genicam_cameras", "cameras/video_cameras", "motion_capture/sensor",
    }  # fmt: skip
    options = {"mujoco": {"model": str(ROOT / "examples/python/models/cart_pole.xml")}}
    silent = set()
    for package in ("robots/arms", "robots/pam", "simulators/mujoco"):
        project = tomllib.loads((ROOT / package / "pyproject.toml").read_text())["project"]
        for name in project["entry-points"]["o80.robots"].keys() - {"so101_twin"}:  # is mujoco
            if not o80.robots.load(name).describe(**options.get(name, {}))["simulated"]:
                silent.add(name)
    assert o80.robots.load("two_joints").describe()["simulated"]
    devices = ROOT / "devices" / "o80_devices"
    for file in devices.rglob("*.py"):
        text = file.read_text()
        if "def read(self, reading" in text and "simulated = True" not in text:
            silent.add(str(file.relative_to(devices).with_suffix("")))
    assert silent == hardware


def installed(folder: Path, name: str, entry_points: str) -> None:
    """Writes what an installation notes of a package."""
    metadata = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(entry_points)


def test_a_package_that_fails_does_not_hide_other_robots(tmp_path: Path) -> None:
    (tmp_path / "broken_arm.py").write_text("raise ValueError('no licence')\n")
    installed(tmp_path, "broken-arm", "[o80.robots]\nbroken = broken_arm:library\n")
    program = (
        "import warnings, o80\n"
        "warnings.simplefilter('error')\n"
        "assert 'two_joints' in [robot.name for robot in o80.robots.list()]\n"
        "o80.robots.load('two_joints')\n"
        "try: o80.robots.load('broken')\n"
        "except o80.DriverError as error:\n"
        "    assert 'broken-arm' in str(error) and 'no licence' in str(error), error\n"
        "else: raise AssertionError\n"
    )
    run_python("-c", program, env=os.environ | {"PYTHONPATH": str(tmp_path)})


def test_python_packages_bring_robots_and_frontends(tmp_path: Path, segment: str) -> None:
    package = tmp_path / "joints"
    package.mkdir()
    path = o80.robots.load("two_joints").path
    (package / "__init__.py").write_text(
        "import o80\n"
        f"path = {str(path)!r}\n"
        "def library(): return path\n"
        "class Joints(o80.Frontend):\n"
        "    def elbow(self): return self.latest().observed[1]\n"
    )
    robots = "[o80.robots]\njoints_of_a_package = joints:library\njoints_by_path = joints:path\n"
    installed(tmp_path, "joints", f"{robots}[o80.frontends]\ntwo_joints = joints:Joints\n")
    program = (
        "import o80\n"
        "assert 'joints_of_a_package' in [robot.name for robot in o80.robots.list()]\n"
        "o80.robots.load('joints_by_path')\n"
        f"with o80.robots.load('joints_of_a_package').inline({segment!r}) as arm:\n"
        "    assert type(arm).__name__ == 'Joints', arm\n"
        "    assert arm.elbow() == 0\n"
        f"    with o80.Frontend({segment!r}) as other:\n"
        "        assert type(other).__name__ == 'Joints', other\n"
    )
    run_python("-c", program, env=os.environ | {"PYTHONPATH": str(tmp_path)})


# ---------------------------------------------------------------------------- processes


def test_the_segment_has_the_name_of_the_robot_unless_another_is_given() -> None:
    robot = o80.robots.load("two_joints")
    with robot.start() as process:
        assert process.segment == "two_joints"
        with pytest.raises(o80.SegmentTaken, match=str(process.pid)):
            robot.start()


def test_options_and_flags_reach_the_robot(segment: str) -> None:
    with o80.robots.load("two_joints").start(
        segment,
        bursting=True,
        history=64,
        lanes=2,
        lane_blocks=64,
        permission=0o640,
        stale="purge",
        silence=1000,
        reach=1.5,
        gain=1e-9,
    ) as process:
        with process.frontend() as arm:
            assert arm.bursting
            assert arm.actuators[0].limits.maximum == 1.5
            arm.add_command(0, 1.0)
            assert arm.burst(100, timeout=WAIT).observed[0] < 1e-6
            assert len(arm.history()) == 64
        file = Path(os.environ["O80_DIRECTORY"], f"o80-{segment}")
        assert file.stat().st_mode & 0o777 == 0o640


def test_a_process_never_stopped_is_warned_about_and_stopped(segment: str) -> None:
    process = o80.robots.load("two_joints").start(segment)
    popen = process._popen

    with pytest.warns(ResourceWarning, match="never stopped"):
        del process

    assert popen.returncode == 0


# ---------------------------------------------------------------------------- inline


STOPPED = """
before = set(os.listdir("/proc/self/fd"))
with o80.robots.load("two_joints").start(sys.argv[1]) as process:
    process.output  # reading it opens nothing; it may still be empty
assert "runs on segment" in process.output
del process
gc.collect()
print(sorted(set(os.listdir("/proc/self/fd")) - before))
"""


def test_a_process_that_was_stopped_leaves_nothing_open(segment: str) -> None:
    # in a program of its own: here, gc.collect() would also find what other tests have left
    program = f"import gc, os, sys\nimport o80\n{STOPPED}"
    done = run_python("-W", "error", "-c", program, segment)
    assert (done.stdout, done.stderr) == ("[]\n", "")


DRIVER = """
class Joint:
    actuators = ("x",)

    def read(self, reading):
        reading.observed[0] = 0.0
"""


def test_another_file_with_the_name_of_a_loaded_one_is_refused(tmp_path: Path) -> None:
    """It must not become the robot of the first file."""
    places = []
    for folder in ("first", "second"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "same_joint.py").write_text(DRIVER)
        places.append(f"{tmp_path / folder / 'same_joint.py'}:Joint")
    o80.robots.load(places[0])
    said = rf"another module 'same_joint', of {tmp_path / 'first'}.*rename the file"
    with pytest.raises(o80.DriverError, match=said):
        o80.robots.load(places[1])


def test_a_file_that_was_imported_by_a_link_is_the_same_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    (tmp_path / "real" / "linked_joint.py").write_text(DRIVER)
    monkeypatch.syspath_prepend(tmp_path / "link")
    importlib.import_module("linked_joint")
    for folder in ("real", "link"):
        place = f"{tmp_path / folder / 'linked_joint.py'}:Joint"
        assert o80.robots.load(place).name == "joint"


# ----------------------------------------- controllers in real time, and the guard of their threads


TWO_CONTROLLERS = """
import os, subprocess, sys, threading, time, o80

ready, over = threading.Event(), threading.Event()
policies = {}

def waits(process):
    with process.frontend(real_time=True):
        ready.set()
        over.wait()
        ask = "import os; print(os.sched_getscheduler(0))"
        policies["child"] = subprocess.check_output([sys.executable, "-c", ask], text=True)
        policies["waits"] = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority

def spins(process):
    with process.frontend(real_time=True) as arm:
        arm.wait_for_next()
        policies["before"] = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
        other = threading.Thread(target=waits, args=[process])
        other.start()
        ready.wait()
        end = time.monotonic() + 30
        while os.sched_getscheduler(0) & os.SCHED_FIFO and time.monotonic() < end:
            pass
        policies["after"] = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, 0
        over.set()
        other.join()

robot = o80.robots.load("two_joints")
with robot.start(sys.argv[1], policy="fifo", priority=50) as process:
    controller = threading.Thread(target=spins, args=[process])
    controller.start()
    controller.join()
    policies["main"] = os.sched_getscheduler(0), 0
print(policies)
"""


def test_a_controller_that_does_not_sleep_becomes_an_ordinary_thread_and_no_other(
    segment: str,
) -> None:
    if not may_use_fifo():
        pytest.skip("this user may not use the policy fifo")
    ran = run_python("-c", TWO_CONTROLLERS, segment)
    assert ast.literal_eval(ran.stdout) == {
        "before": (os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 49),
        "after": (os.SCHED_OTHER, 0),
        "waits": (os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 49),
        "child": "0\n",  # the guard is not inherited, so the policy is not
        "main": (os.SCHED_OTHER, 0),
    }
    assert "lost its real-time priority" in ran.stderr


def test_no_controller_gets_a_priority_above_that_of_the_loop(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment, policy="auto") as process:
        assert "policy auto: other" in process.output, "it is simulated"
        with pytest.warns(RuntimeWarning, match="the loop has no real-time priority above 1"):
            process.frontend(real_time=True).close()
        assert os.sched_getscheduler(0) == os.SCHED_OTHER
