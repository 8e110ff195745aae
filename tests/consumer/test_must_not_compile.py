"""Mistakes in a driver class are errors with a sentence, when the driver is compiled."""

import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from compilers import COMPILERS

import o80

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
TWO_FIELDS = """struct Sampled { double position; %s; };
O80_DESCRIBE(Sampled, (position, "[rad]"), (samples, "of the last millisecond"));"""
RIGHT_FIELDS = TWO_FIELDS % "std::array<double, 3> samples"
SERVER = """
#include "o80/o80.hpp"
struct Plain { using Actuators = std::array<double, 2>; %s };
void serve(o80::Backend<Plain>& backend) {
  backend.on<o80::Reset>([](const o80::Reset&) { return o80::Served::done(); });
}"""
PARTS = """
struct Parts { std::array<Sampled, 2> joint; double grip; };
O80_DESCRIBE(Parts, %s, (grip, "[N]"));
inline void add_to(o80::Schema& schema) { o80::describe_actuators<Parts>(schema); }"""
ENDS = "void read(o80::Reading<Arm>& reading) { reading.ended<Home>(o80::Served::done()); }"
DESCRIBE = "void describe(o80::Schema&) const {}"
REQUESTS = "using Requests = o80::Requests<Home>; "
ON = "void on(const Home&) {}"
RESUME = "o80::Served resume() { return o80::Served::done(); }"

#: By name: the sentence, the place of the mistake, the mistake, and what is right there.
MISTAKES = {
    "config_that_is_not_described": (
        "a driver's Config must be described",
        "config",
        "",
        RIGHT["config"],
    ),
    "start_that_answers": (
        "a driver needs `void start()`",
        "start",
        "bool start() { return false; }",
        RIGHT["start"],
    ),
    "write_that_answers": (
        "a driver needs `void write(",
        "write",
        "bool write(const o80::Desired<Arm>&) { return false; }",
        RIGHT["write"],
    ),
    "read_that_answers": (
        "a driver needs `void read(",
        "read",
        "bool read(o80::Reading<Arm>&) { return false; }",
        RIGHT["read"],
    ),
    "without_read": ("a driver needs `void read(", "read", "", RIGHT["read"]),
    "stop_that_answers": (
        "a driver needs `void stop() noexcept`",
        "stop",
        "int stop() noexcept { return 1; }",
        RIGHT["stop"],
    ),
    "stop_that_throws": (
        "a driver needs `void stop() noexcept`",
        "stop",
        "void stop() {}",
        RIGHT["stop"],
    ),
    "misspelt_halt": ("rename it to `halt`", "more", "void on_halt() {}", "void halt() {}"),
    "halt_with_an_argument": (
        "halt must be `void halt()`",
        "more",
        "void halt(bool) {}",
        "void halt() {}",
    ),
    "misspelt_resume": ("rename it to `resume`", "more", RESUME.replace("ume", "me"), RESUME),
    "resume_that_answers_a_truth": (
        "resume must be `void resume()` or `o80::Served resume()`",
        "more",
        "bool resume() { return true; }",
        RESUME,
    ),
    "wait_for_a_duration": (
        "wait must be `void wait(std::int64_t due)`",
        "more",
        "void wait(std::chrono::nanoseconds) {}",
        "void wait(std::int64_t) {}",
    ),
    "wait_for_a_short_number": (
        "wait must be",
        "more",
        "void wait(int) {}",
        "void wait(long long) {}",
    ),
    "wait_that_answers": (
        "wait must be",
        "more",
        "bool wait(std::int64_t) { return true; }",
        "void wait(std::int64_t) {}",
    ),
    "misspelt_describe": (
        "rename it to `describe`",
        "more",
        DESCRIBE.replace("descr", "desr"),
        DESCRIBE,
    ),
    "describe_a_copy": ("describe must be", "more", "void describe(int) const {}", DESCRIBE),
    "describe_in_private": ("describe must be", "more", "private: " + DESCRIBE, DESCRIBE),
    "describe_without_const": (
        "describe must be `void describe(o80::Schema& schema) const`",
        "more",
        "void describe(o80::Schema&) {}",
        DESCRIBE,
    ),
    "misspelt_extended": (
        "a driver names its sensor values by `using Extended",
        "more",
        "using Extension = Force;",
        "using Extended = Force;",
    ),
    "extended_that_is_not_described": (
        "a driver's Extended must be a struct of numbers",
        "more",
        "struct Torque { double x; }; using Extended = Torque;",
        "using Extended = Force;",
    ),
    "misspelt_requests": (
        "a driver lists its requests as",
        "more",
        REQUESTS.replace("Requests =", "Requets =") + ON,
        REQUESTS + ON,
    ),
    "singular_requests": (
        "a driver lists its requests as",
        "more",
        REQUESTS.replace("Requests =", "Request =") + ON,
        REQUESTS + ON,
    ),
    "requests_of_another_kind": (
        "Requests must be `o80::Requests<...>`",
        "more",
        REQUESTS.replace("o80::Requests", "std::tuple") + ON,
        REQUESTS + ON,
    ),
    "requests_in_private": (
        "a driver's Requests must be public",
        "more",
        "private: " + REQUESTS + "public: " + ON,
        REQUESTS + ON,
    ),
    "requests_that_nothing_serves": (
        "each struct in a driver's Requests needs",
        "more",
        REQUESTS + "void on(Home&) {}",
        REQUESTS + ON,
    ),
    "requests_that_answer_a_truth": (
        "each struct in a driver's Requests needs",
        "more",
        REQUESTS + "bool on(const Home&) { return true; }",
        REQUESTS + "o80::Served on(const Home&) { return o80::Served::done(); }",
    ),
    "handlers_without_requests": (
        "a driver with `on(...)` must list its requests",
        "more",
        ON,
        REQUESTS + ON,
    ),
    "request_that_is_not_described": (
        "each of o80::Requests must be a struct of numbers that O80_DESCRIBE describes",
        "more",
        "struct Grasp { double force = 1.0; }; " + (REQUESTS + ON).replace("Home", "Grasp"),
        REQUESTS + ON,
    ),
    "end_of_a_request_that_is_not_listed": (
        "this struct is not among the Requests of the driver",
        "read",
        ENDS,
        ENDS + REQUESTS + "o80::Served on(const Home&) { return o80::Served::running(); }",
    ),
    "server_of_a_request_that_is_not_listed": (
        "this struct is not among the Requests of the robot",
        "state",
        RIGHT["state"] + SERVER % "",
        RIGHT["state"] + SERVER % "using Requests = o80::Requests<o80::Reset>;",
    ),
    "state_that_is_not_described": (
        "a state is a number, a described enum or a struct that O80_DESCRIBE describes",
        "state",
        "struct Sampled { double position; };",
        RIGHT["state"],
    ),
    "world_of_a_whole_robot": (
        "every robot is of the world unless describe() calls schema.simulated(): remove",
        "more",
        "void describe(o80::Schema& schema) const { schema.of_the_world(); }",
        "void describe(o80::Schema& schema) const { schema.simulated(); }",
    ),
    "unit_of_an_actuator_that_is_a_struct": (
        "an actuator whose state is a struct takes no unit",
        "state",
        RIGHT["state"] + PARTS % '(joint, "[rad]")',
        RIGHT["state"] + PARTS % "joint",
    ),
    "misspelt_field": (
        "positon",
        "state",
        RIGHT["state"].replace("(position", "(positon"),
        RIGHT["state"],
    ),
    "forgotten_field": (
        "Sampled: describe every field, once",
        "state",
        RIGHT["state"].replace("position;", "position; double velocity;"),
        RIGHT_FIELDS,
    ),
    "state_with_an_array_of_c": (
        "Sampled: describe every field, once",
        "state",
        TWO_FIELDS % "double samples[3]",
        RIGHT_FIELDS,
    ),
    **{
        f"state_with_{name}": (
            "Sampled::samples cannot be shared between processes",
            "state",
            TWO_FIELDS % f"{kind} samples",
            RIGHT_FIELDS,
        )
        for name, kind in {
            "a_character": "char",
            "a_pointer": "double*",
            "a_string": "std::string",
            "a_vector": "std::vector<double>",
            "an_array_of_vectors": "std::array<std::vector<double>, 3>",
            "an_enumeration_that_is_not_described": "enum class Gear { low, high }",
        }.items()
    },
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
    sentence, place, mistake, _ = MISTAKES[name]

    assert sentence in errors(compiler, place, mistake, compiled_headers(compiler))[0]


def test_without_the_mistakes_they_compile(compiled_headers: Flags) -> None:
    for place, right in {(place, right) for _, place, _, right in MISTAKES.values()}:
        assert errors("g++", place, right, compiled_headers("g++")) == [], right
