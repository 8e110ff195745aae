"""What `o80 list` and `o80 info` say of robots whose driver hangs or is late."""

import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import o80

WAIT = 60.0  # [s] longer than any wait should take
O80 = str(Path(sys.executable).parent / "o80")

DRIVER = """
#include <unistd.h>
#include <array>
#include <string>
#include "o80/robot.hpp"

class Hanging {
 public:
  struct Config { std::string verb = "none"; };
  using Actuators = std::array<double, 1>;
  explicit Hanging(const Config& config) : verb_(config.verb) {}
  void start() { hang_in("start"); }
  void write(const o80::Desired<Hanging>& desired) {
    if (desired.iteration() == 20) hang_in("write");
    if (verb_ == "late") usleep(5000);
  }
  void read(o80::Reading<Hanging>&) {}
  void stop() noexcept {}

 private:
  void hang_in(const std::string& verb) const {
    while (verb == verb_) pause();
  }
  std::string verb_;
};
O80_DESCRIBE(Hanging::Config, verb);
O80_ROBOT(hanging, Hanging)
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot library that hangs where it is told to."""
    folder = tmp_path_factory.mktemp("hanging")
    (folder / "hanging.cpp").write_text(DRIVER)
    include = Path(o80.__file__).parent / "include"
    compiler = (sysconfig.get_config_var("CXX") or "g++").split()[0]
    subprocess.run(
        [compiler, "-std=c++20", "-shared", "-fPIC", "-fvisibility=hidden", f"-I{include}",
         "hanging.cpp", "-o", "hanging.so"],
        cwd=folder,
        check=True,
    )  # fmt: skip
    return folder / "hanging.so"


Hang = Callable[[str], None]


@pytest.fixture
def hang(library: Path, segment: str) -> Iterator[Hang]:
    """Starts a robot that hangs in a verb."""
    started: list[subprocess.Popen[bytes]] = []

    def start(verb: str) -> None:
        command = [O80, "run", str(library), "--segment", segment, "--verb", verb]
        started.append(subprocess.Popen(command, stderr=subprocess.DEVNULL))

    yield start
    for process in started:
        process.kill()
        process.wait()
    o80.clean(segment)


def said(*command: str) -> str:
    return subprocess.run([O80, *command], capture_output=True, text=True, timeout=WAIT).stdout


def until_said(text: str, *command: str) -> str:
    """Asks again and again until the answer has the text."""
    end = time.monotonic() + WAIT
    answer = ""
    while text not in answer:
        assert time.monotonic() < end, answer
        answer = said(*command)
    return answer


def test_a_start_that_does_not_return_is_listed(segment: str, hang: Hang) -> None:
    hang("start")

    answer = until_said(f"{segment}: start", "list")

    assert "has not returned for" in answer


def test_a_verb_that_does_not_return_is_listed_and_so_are_missing_rows(
    segment: str, hang: Hang
) -> None:
    hang("write")

    until_said(f"{segment}: write has not returned for", "list")
    answer = until_said("no row for", "info", segment)

    assert "write has not returned for" in answer


def test_late_iterations_are_listed_with_the_rate_that_is_reached(segment: str, hang: Hang) -> None:
    hang("late")

    until_said("Hz reached of 1000", "list")
    answer = until_said("Hz reached of 1000", "info", segment)

    assert "iterations were late" in answer
