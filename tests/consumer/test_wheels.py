"""Wheels and source distributions: built, then used where nothing else is."""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

pytestmark = [pytest.mark.check, pytest.mark.timeout(1500)]

ROOT = Path(__file__).resolve().parents[2]
OTHERS = (
    "o80_mujoco",
    "o80_pam",
    "o80_arms",
    "o80_devices",
    "lerobot_robot_o80",
    "o80_ros2",
    "o80_table_tennis",
)
NOT_FOR_THE_CORE = {"gymnasium", "h5py", "imageio-ffmpeg", "matplotlib", "mujoco-core"}


def pythons() -> dict[int, str]:
    """This interpreter and those on the PATH that have headers, by the y of Python 3.y."""
    probe = "import os, sysconfig, venv; os.stat(sysconfig.get_path('include') + '/Python.h')"
    found = {sys.version_info.minor: sys.executable}
    for minor in range(11, 15):
        python = shutil.which(f"python3.{minor}")
        if python and not subprocess.run([python, "-c", probe], capture_output=True).returncode:
            found.setdefault(minor, python)
    return found


PYTHONS = pythons()


class Environment:
    """An empty virtual environment. Its programs find no compiler unless `compiler` is set.

    checkout: a folder laid out as ours, with this as its `.venv`, in which ccache finds what
    tools/setup.sh has compiled.
    """

    def __init__(
        self,
        folder: Path,
        *,
        python: str = sys.executable,
        compiler: bool = False,
        checkout: Path | None = None,
    ) -> None:
        subprocess.run([python, "-m", "venv", "--without-pip", folder], check=True)
        self.folder = folder
        self.compiler = compiler
        self.checkout = checkout

    def run(self, program: str, *words: str | Path, fails: bool = False) -> str:
        """Runs a program of the environment; returns what it prints."""
        return self.run_path(self.folder / "bin" / program, *words, fails=fails)

    def pip(self, *words: str | Path) -> str:
        """Runs our pip for the environment, which has none of its own: making one takes long."""
        python = self.folder / "bin" / "python"
        return self.run_path(Path(sys.executable), "-m", "pip", "--python", python, *words)

    def run_path(self, program: Path, *words: str | Path, fails: bool = False) -> str:
        path = str(self.folder / "bin")
        given = {
            name: value
            for name, value in os.environ.items()
            if name.startswith(("PIP_", "O80_", "CCACHE_"))
        }
        given |= {"HOME": str(self.folder), "PIP_CACHE_DIR": str(Path.home() / ".cache" / "pip")}
        if self.compiler:
            path += f"{os.pathsep}/usr/bin{os.pathsep}/bin"
            # the same sources are compiled for each build that pip isolates
            if shutil.which("ccache", path=os.defpath):
                given |= {"CMAKE_CXX_COMPILER_LAUNCHER": "ccache", "CCACHE_NOHASHDIR": "1"}
                given["CCACHE_BASEDIR"] = str(self.checkout or "/")
                given.setdefault("CCACHE_DIR", str(ROOT / "build" / "ccache"))
            if not self.checkout:  # not optimised: what is shipped was built
                given["SKBUILD_CMAKE_BUILD_TYPE"] = "None"
        done = subprocess.run(
            [program, *words],
            env=given | {"PATH": path},
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert (done.returncode != 0) == fails, done.stdout
        return done.stdout

    def python(self, program: str, *, fails: bool = False) -> str:
        """Runs a Python program."""
        return self.run("python", "-c", program, fails=fails).strip()

    def install(self, *words: str | Path) -> None:
        """Installs wheels, with what they need from the package index."""
        self.pip("-q", "install", "--no-compile", *words)

    def packages(self) -> set[str]:
        """Names of all that is installed."""
        listed = self.pip("list", "--format=json")
        return {each["name"] for each in json.loads(listed)}

    def megabytes(self) -> float:
        """Size of what is installed, without pip."""
        files = (file for file in (self.folder / "lib").rglob("*") if file.is_file())
        own = (f for f in files if not re.search(r"site-packages/(pip|setuptools)\b", str(f)))
        return sum(file.stat().st_size for file in own) / 1e6


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with wheels and sdists."""
    output = tmp_path_factory.mktemp("built")
    command = [sys.executable, "tools/wheels.py", f"--output={output}"]
    command += [f"--python={python}" for python in PYTHONS.values()]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    print(done.stdout)
    return output


@pytest.fixture(scope="module", params=PYTHONS, ids="python3.{}".format)
def core(
    request: pytest.FixtureRequest, built: Path, tmp_path_factory: pytest.TempPathFactory
) -> Environment:
    """An environment in which only o80 is installed."""
    environment = Environment(tmp_path_factory.mktemp("core"), python=PYTHONS[request.param])
    environment.install("--only-binary=:all:", f"--find-links={built / 'wheels'}", "o80")
    print(f"pip install o80: {environment.megabytes():.0f} MB")
    return environment


@pytest.fixture(scope="module", params=PYTHONS, ids="python3.{}".format)
def everything(
    request: pytest.FixtureRequest, built: Path, tmp_path_factory: pytest.TempPathFactory
) -> Environment:
    """An environment with the application, and so with all packages."""
    environment = Environment(tmp_path_factory.mktemp("everything"), python=PYTHONS[request.param])
    wheels = f"--find-links={built / 'wheels'}"
    environment.install("--only-binary=:all:", wheels, "o80-table-tennis")
    print(f"pip install o80-table-tennis: {environment.megabytes():.0f} MB")
    return environment


def readme_program(package: str) -> str:
    """The first Python program in the README of a package."""
    text = (ROOT / package / "README.md").read_text()
    program: str = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[0]
    return program


def test_wheels_are_for_every_machine_of_the_platform_and_every_python_that_is_here(
    built: Path,
) -> None:
    tags: dict[str, set[str]] = {}
    for file in (built / "wheels").iterdir():
        name, _, tag = file.stem.split("-", 2)
        tags.setdefault(name, set()).add(tag)

    native = f"manylinux_2_35_{platform.machine()}"
    bindings = {f"cp3{minor}-cp3{minor}-{native}" for minor in PYTHONS}
    of_package = {"o80": bindings, "o80_mujoco": bindings, "o80_devices": bindings}
    of_package |= {name: {f"py3-none-{native}"} for name in ("o80_pam", "o80_arms")}
    assert tags == {name: {"py3-none-any"} for name in OTHERS} | of_package
    assert max(file.stat().st_size for file in (built / "wheels").iterdir()) < 2e6


def test_the_core_brings_and_loads_only_what_it_needs(core: Environment) -> None:
    assert "o80" in core.packages()
    assert not core.packages() & NOT_FOR_THE_CORE
    assert (
        core.python("import shutil; print(shutil.which('c++'), shutil.which('gcc'))") == "None None"
    )
    loaded = core.python(
        "import sys, o80; print(sorted({m.partition('.')[0] for m in sys.modules}))"
    )
    assert not set(re.findall(r"\w+", loaded)) & {"numpy", "typer", "rich", "mujoco", "gymnasium"}


def test_the_core_runs_its_robot_inline_and_as_a_process(core: Environment) -> None:
    program = """
import o80
robot = o80.robots.load("two_joints")
with robot.inline() as arm:
    arm.add_command("elbow", 0.5, iterations=10)
    assert arm.burst(10).desired[1] == 0.5
with robot.start() as process, process.frontend() as arm:
    arm.add_command("elbow", 0.5, duration=0.05)
    print(arm.pulse_and_wait(timeout=30).desired[1])
"""
    assert core.python(program) == "0.5"
    assert "Type next" in core.run("o80", "demo")
    assert "two_joints" in core.run("o80", "run", "--help")


@pytest.mark.parametrize("robot", ["mujoco", "pam"])
def test_without_its_package_a_robot_is_an_error_that_names_it(
    core: Environment, robot: str
) -> None:
    cure = f"`pip install o80-{robot}`"

    assert cure in core.run("o80", "run", robot, fails=True)
    text = core.python(f"import o80; o80.robots.load({robot!r})", fails=True)
    assert cure in text
    (program,) = core.folder.glob("lib/python3*/site-packages/o80/bin/o80-run")  # in C++
    done = subprocess.run([program, robot], capture_output=True, text=True)
    assert cure in done.stderr


def test_the_application_without_its_robots_says_what_to_install(
    built: Path, core: Environment
) -> None:
    (wheel,) = (built / "wheels").glob("o80_table_tennis-*")
    core.install("--no-deps", wheel)
    try:
        text = core.python("import o80_table_tennis", fails=True)
    finally:
        core.pip("-q", "uninstall", "-y", "o80-table-tennis")

    assert 'pip install "o80-mujoco"' in text


@pytest.mark.parametrize("package", ["simulators/mujoco", "robots/pam"])
def test_the_first_minute_of_a_package_runs_where_no_compiler_is(
    everything: Environment, package: str
) -> None:
    assert everything.python("import shutil; print(shutil.which('c++'))") == "None"
    assert everything.python(readme_program(package))
    everything.pip("check")


def test_the_simulator_loads_the_mujoco_of_its_wheel_and_no_other(everything: Environment) -> None:
    program = """
import o80
o80.robots.load("mujoco")
print({line.split()[-1] for line in open("/proc/self/maps") if "libmujoco" in line})
"""
    (loaded,) = re.findall(r"'(.*?)'", everything.python(program))

    assert Path(loaded).is_relative_to(everything.folder)
    assert Path(loaded).parent.name == "mujoco"


def test_an_episode_of_table_tennis_is_played_inline_and_as_processes(
    everything: Environment,
) -> None:
    program = """
import gymnasium, o80_table_tennis
for processes in (False, True):
    environment = gymnasium.make(o80_table_tennis.ACCELERATED, processes=processes)
    environment.reset(seed=1)
    steps, over = 0, False
    while not over:
        action = environment.action_space.sample() * 0
        _, reward, terminated, truncated, _ = environment.step(action)
        steps, over = steps + 1, terminated or truncated
    environment.close()
    print(steps, reward)
"""
    inline, processes = everything.python(program).splitlines()

    assert int(inline.split()[0]) > 20
    assert inline == processes


def test_robots_of_packages_are_found_in_spawned_processes(everything: Environment) -> None:
    (everything.folder / "spawned.py").write_text(
        "import multiprocessing, o80\n"
        "def name(robot): return robot.name, o80.robots.load('mujoco').name\n"
        "if __name__ == '__main__':\n"
        "    with multiprocessing.get_context('spawn').Pool(1) as pool:\n"
        "        print(pool.apply(name, (o80.robots.load('pam'),)))\n"
    )

    assert "('pam', 'mujoco')" in everything.run("python", "spawned.py")


@pytest.mark.parametrize("package", OTHERS)
def test_a_source_distribution_becomes_a_wheel(built: Path, tmp_path: Path, package: str) -> None:
    (sdist,) = (built / "sdists").glob(f"{package}-[0-9]*.tar.gz")
    builder = Environment(tmp_path / "builder", compiler=True)
    # outside a checkout the build needs a release of o80: the wheel stands for it
    found = f"--find-links={built / 'wheels'}"
    made = tmp_path / "made"
    builder.pip("-q", "wheel", "--no-deps", found, f"-w{made}", sdist)

    (wheel,) = made.iterdir()
    shipped = (built / "wheels").glob(f"{package}-[0-9]*.whl")
    assert wheel.name.split("-")[:4] in [each.name.split("-")[:4] for each in shipped]


def unpack(sdist: Path, folder: Path) -> Path:
    """The files of a source distribution, without the folder that holds them there."""
    folder.mkdir(parents=True)
    subprocess.run(["tar", "xf", sdist, "--strip-components=1", f"-C{folder}"], check=True)
    return folder


def test_source_distributions_that_lie_as_in_a_checkout_install_together(built: Path) -> None:
    """The core ships enough to build it, and the arm finds it beside itself."""
    root = ROOT / "build" / "unpacked"  # the same in each run, for ccache
    shutil.rmtree(root, ignore_errors=True)
    unpacked = []
    for folder, name in ((".", "o80"), ("robots/pam", "o80_pam"), ("apps/tt", "o80_table_tennis")):
        (sdist,) = (built / "sdists").glob(f"{name}-[0-9]*.tar.gz")
        unpacked.append(unpack(sdist, root / folder))
    core, arm, application = unpacked
    environment = Environment(root / ".venv", compiler=True, checkout=root)
    required = tomllib.loads((core / "pyproject.toml").read_text())["build-system"]["requires"]
    environment.install(*required, "cmake", "ninja")
    alone = ("--no-build-isolation", "--no-deps")
    environment.install(*alone, f"-Cbuild-dir={root}/build/pip/o80", core)
    # the simulator has the build backend of the arm, so it is not compiled here
    simulator = f"--find-links={built / 'wheels'}"
    environment.install("--no-build-isolation", arm, application, simulator)
    names = ["two_joints", "pam", "mujoco"]
    robots = f"import o80; print([o80.robots.load(name).name for name in {names}])"
    assert environment.python(robots) == str(names)

    # with isolation the arm is built against the core beside it; here once more, editable
    backend = f"import sys; sys.path.insert(0, {str(arm / 'build_backend')!r}); import beside_o80"
    assert environment.python(f"{backend}; print(beside_o80.o80())") == f"o80 @ {core.as_uri()}"
    environment.install(*alone, "--editable", arm)
    assert environment.python(robots) == str(names)
