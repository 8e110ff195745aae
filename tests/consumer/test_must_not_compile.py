"""Compilers: errors of a mistaken driver class are sentences, and a right one reads few headers."""

import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

import o80

CLANG = "clang++-19"
COMPILERS = [
    pytest.param("g++", id="g++"),
    pytest.param(
        CLANG,
        id=CLANG,
        marks=[
            pytest.mark.check,
            pytest.mark.skipif(shutil.which(CLANG) is None, reason=f"{CLANG} is not installed"),
        ],
    ),
]


#: A driver. A mistake stands in the place of one of its parts.
DRIVER = """
#include <chrono>
#include <string>
#include <tuple>
#include <vector>

#include "o80/robot/make_table.hpp"

struct Home { double speed = 1.0; };
O80_DESCRIBE(Home, speed);
struct Force { double x = 0.0; };
O80_DESCRIBE(Force, x);
%(state)s
class Arm {
 public:
  struct Config {};
  using Actuators = std::array<Sampled, 2>;
  explicit Arm(const Config&) {}
  %(start)s
  %(write)s
  %(read)s
  %(stop)s
  %(more)s
};
%(config)s
O80_ROBOT(arm, Arm)
"""
RIGHT = {
    "state": 'struct Sampled { double position; };\nO80_DESCRIBE(Sampled, (position, "[rad]"));',
    "start": "void start() {}",
    "write": "void write(const o80::Desired<Arm>&) {}",
    "read": "void read(o80::Reading<Arm>&) {}",
    "stop": "void stop() noexcept {}",
    "more": "",
    "config": "O80_DESCRIBE(Arm::Config);",
}
WORDS = RIGHT | {
    "DESCRIBE": "void describe(o80::Schema&) const {}",
    "RESUME": "o80::Served resume() { return o80::Served::done(); }",
    "HOME": "using Requests = o80::Requests<Home>;",
    "ON": "void on(const Home&) {}",
    "ENDS": "void read(o80::Reading<Arm>& reading) { reading.ended<Home>(o80::Served::done()); }",
    "INCLUDE": '\n#include "o80/o80.hpp"\n',
    "SERVE": """void serve(o80::Backend<Plain>& backend) {
  backend.on<o80::Reset>([](const o80::Reset&) { return o80::Served::done(); });
}""",
    "PARTS": RIGHT["state"] + "struct Parts { std::array<Sampled, 2> joint; double grip; };",
    "ADD": "inline void add_to(o80::Schema& schema) { o80::describe_actuators<Parts>(schema); }",
    "SHARED": "Sampled::samples cannot be shared between processes",
    "THREE": "struct Sampled { double position; std::array<double, 3> samples; };",
    "TWO": """
O80_DESCRIBE(Sampled, (position, "[rad]"), (samples, "of the last millisecond"));""",
}
TABLE = Path(__file__).with_name("mistakes.txt").read_text().splitlines()[1:]
#: By name: the place of the mistake, the sentence, the mistake, and what is right there.
MISTAKES = {
    name: [cell % WORDS for cell in cells]
    for name, *cells in ([cell.strip() for cell in row.split(" |")] for row in TABLE)
}
HEADERS = Path(o80.__file__).parent / "include"
LANGUAGE = ("-std=c++20", f"-I{HEADERS}")


Flags = Callable[[str], tuple[str, ...]]


@pytest.fixture(scope="module")
def compiled_headers(tmp_path_factory: pytest.TempPathFactory) -> Flags:
    """Flags that give a compiler what all programs include, compiled once."""
    folder = tmp_path_factory.mktemp("headers")
    header = folder / "robot.hpp"
    header.write_text('#include "o80/robot/make_table.hpp"\n')

    @cache
    def flags(compiler: str) -> tuple[str, ...]:
        compiled = folder / f"robot.hpp.{'gch' if compiler == 'g++' else 'pch'}"
        command = [compiler, *LANGUAGE, "-x", "c++-header", str(header), "-o", str(compiled)]
        subprocess.run(command, check=True)
        if compiler == "g++":
            return ("-Winvalid-pch", "-Werror=invalid-pch", "-include", str(header))
        return ("-include-pch", str(compiled))

    return flags


def errors(compiler: str, place: str, text: str, flags: tuple[str, ...]) -> list[str]:
    """Messages of the compiler for the driver with this text in the place."""
    compiled = subprocess.run(
        [compiler, *LANGUAGE, "-fsyntax-only", *flags, "-x", "c++", "-"],
        input=DRIVER % (RIGHT | {place: text}),
        capture_output=True,
        text=True,
    )
    found = [line for line in compiled.stderr.splitlines() if "error:" in line]
    assert (compiled.returncode != 0) == bool(found), compiled.stderr
    return found


@pytest.mark.parametrize("name", MISTAKES)
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_first_error_says_what_is_wrong(
    compiler: str, name: str, compiled_headers: Flags
) -> None:
    place, sentence, mistake, _ = MISTAKES[name]

    assert sentence in errors(compiler, place, mistake, compiled_headers(compiler))[0]


def test_without_the_mistakes_they_compile(compiled_headers: Flags) -> None:
    for place, right in {(place, right) for place, _, _, right in MISTAKES.values()}:
        assert errors("g++", place, right, compiled_headers("g++")) == [], right


ROBOT = Path(__file__).parent / "headers_only.cpp"

#: All of it: no frontend, backend, lane, spinner or lock. Every robot is compiled again when one of
#: these changes.
NEEDED = """
base/error base/nearest_name base/time base/version
describe/defaults describe/describe describe/described describe/face describe/for_each
describe/hooks describe/options describe/rows describe/schema describe/schema_bytes
describe/shown_model
robot robot/driver robot/driver_checks robot/make_table robot/plant_requests robot/table
runtime/request_server runtime/robot_types
"""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_robot_library_reads_only_what_a_robot_needs(compiler: str) -> None:
    compiled = subprocess.run(
        [compiler, *LANGUAGE, "-MM", ROBOT],
        capture_output=True,
        text=True,
        check=True,
    )
    prefix = f"{HEADERS / 'o80'}/"
    read = {
        word.removeprefix(prefix).removesuffix(".hpp")
        for word in compiled.stdout.replace("\\\n", " ").split()
        if word.startswith(prefix)
    }

    assert "robot/make_table" in read
    assert read - set(NEEDED.split()) == set()
