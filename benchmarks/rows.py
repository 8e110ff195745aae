"""Every budget, what is measured for it, and what it is measured against."""

from dataclasses import dataclass

Limit = float | tuple[float, str]
"""A fixed one, or a factor of a baseline that the same program measures."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table."""

    name: str  # for --rows
    row: str
    budget: str  # in words
    program: str  # of programs.py
    measured: str  # name of its sample
    limit: Limit
    at_least: bool = False  # more is better


CACHE_LINE = "3 x a bare cache-line round trip"
HALF_MEMCPY = "half of memcpy's bandwidth"

ROWS = (
    Row(
        name="burst",
        row="burst(1), round trip, spinning, C++",
        budget=CACHE_LINE,
        program="burst",
        measured="burst_1",
        limit=(3.0, "cache_line_round_trip"),
    ),
    Row(
        name="burst-python",
        row="burst(1), round trip, from Python",
        budget="1.5 us",
        program="frontend",
        measured="python_burst_1",
        limit=1.5,
    ),
    Row(
        name="iteration-2",
        row="burst(n), per iteration, 2 actuators, empty driver",
        budget="100 ns",
        program="iterations",
        measured="iteration_2_empty",
        limit=100.0,
    ),
    Row(
        name="iteration-8",
        row="one iteration, 8 actuators interpolating, 256 B extended",
        budget="200 ns",
        program="iterations",
        measured="iteration_8_moving",
        limit=200.0,
    ),
    Row(
        name="journal",
        row="an iteration that takes 8 commands, with journal",
        budget="1.05 x the same without",
        program="journal",
        measured="iteration_with_journal",
        limit=(1.05, "iteration_without_journal"),
    ),
    Row(
        name="worst-8",
        row="worst iteration of any load, 8 actuators",
        budget="100 us",
        program="worst-iteration",
        measured="worst_iteration_8",
        limit=100.0,
    ),
    Row(
        name="worst-64",
        row="the same, 64 actuators",
        budget="250 us",
        program="worst-iteration",
        measured="worst_iteration_64",
        limit=250.0,
    ),
    Row(
        name="latest",
        row="latest() from Python",
        budget="0.15 us",
        program="frontend",
        measured="python_latest",
        limit=0.15,
    ),
    Row(
        name="history",
        row="history of 10 000 observations into NumPy",
        budget=HALF_MEMCPY,
        program="frontend",
        measured="python_history",
        limit=(0.5, "memcpy_same_bytes"),
        at_least=True,
    ),
    Row(
        name="history-small",
        row="the same in C++, rows of 88 B",
        budget=HALF_MEMCPY,
        program="history",
        measured="history_small_rows",
        limit=(0.5, "memcpy_small_rows"),
        at_least=True,
    ),
    Row(
        name="history-large",
        row="the same in C++, rows of 440 B",
        budget=HALF_MEMCPY,
        program="history",
        measured="history_large_rows",
        limit=(0.5, "memcpy_large_rows"),
        at_least=True,
    ),
    Row(
        name="add-command",
        row="add_command from Python",
        budget="0.3 us",
        program="frontend",
        measured="python_add_command",
        limit=0.3,
    ),
    Row(
        name="pulse",
        row="pulse of 1000 commands from Python",
        budget="40 us",
        program="frontend",
        measured="python_pulse_1000",
        limit=40.0,
    ),
    Row(
        name="trajectory",
        row="trajectory (10 000, 8) from NumPy",
        budget="1 ms",
        program="frontend",
        measured="python_trajectory",
        limit=1.0,
    ),
    Row(
        name="wake-sleeping",
        row="wake-up of a waiting reader, sleeping",
        budget="1.2 x a bare futex wake-up",
        program="wake-up",
        measured="row_wake_up_sleeping",
        limit=(1.2, "futex_wake_up"),
    ),
    Row(
        name="wake-spinning",
        row="wake-up of a waiting reader, spinning",
        budget="3 x a cache-line hop",
        program="wake-up",
        measured="row_wake_up_spinning",
        limit=(3.0, "cache_line_hop"),
    ),
    Row(
        name="jitter",
        row="jitter of the 1 kHz loop, 99th percentile",
        budget="1.1 x cyclictest beside it",
        program="jitter",
        measured="loop_lateness_p99",
        limit=(1.1, "cyclictest_p99"),
    ),
    Row(
        name="readers",
        row="64 readers attached: an iteration of the writer",
        budget="less than 10 % more than alone",
        program="readers",
        measured="writer_with_64_readers",
        limit=(1.1, "writer_alone"),
    ),
    Row(
        name="waiters",
        row="64 readers that wait for every row at 1 kHz: writer busy",
        budget="less than 10 % of the period",
        program="readers",
        measured="paced_writer_with_64_waiters",
        limit=100.0,  # of 1000 us
    ),
    Row(
        name="ready",
        row="backend ready after start",
        budget="50 ms",
        program="start",
        measured="backend_ready",
        limit=50.0,
    ),
    Row(
        name="attached",
        row="frontend attached",
        budget="1 ms",
        program="start",
        measured="frontend_attached",
        limit=1.0,
    ),
    Row(
        name="ready-python",
        row="backend ready after start, from Python",
        budget="50 ms",
        program="frontend",
        measured="python_backend_ready",
        limit=50.0,
    ),
    Row(
        name="attached-python",
        row="frontend attached, from Python",
        budget="1 ms",
        program="frontend",
        measured="python_frontend_attached",
        limit=1.0,
    ),
    Row(
        name="import",
        row="import o80",
        budget="1.5 x import numpy",
        program="import",
        measured="import_o80",
        limit=(1.5, "import_numpy"),
    ),
    Row(
        name="list",
        row="o80 list, the whole command",
        budget="0.3 s",
        program="import",
        measured="o80_list",
        limit=0.3,
    ),
    Row(
        name="memory-reserved",
        row="a segment of 8 actuators and 1e5 rows, reserved",
        budget="1.3 x rows and lanes",
        program="memory",
        measured="reserved",
        limit=(1.3, "payload"),
    ),
    Row(
        name="memory-resident",
        row="the same, resident",
        budget="1.3 x rows and lanes",
        program="memory",
        measured="resident",
        limit=(1.3, "payload"),
    ),
    Row(
        name="recording-1",
        row="recording 1 segment at 1 kHz, rows of 512 B, with journal",
        budget="5 % of a processor",
        program="recording",
        measured="recording_1",
        limit=5.0,
    ),
    Row(
        name="recording-4",
        row="the same, 4 segments",
        budget="25 % of a processor",
        program="recording",
        measured="recording_4",
        limit=25.0,
    ),
    Row(
        name="recording-16",
        row="the same, 16 segments",
        budget="25 % of a processor",
        program="recording",
        measured="recording_16",
        limit=25.0,
    ),
    Row(
        name="recording-missed",
        row="rows lost in these recordings",
        budget="0",
        program="recording",
        measured="recording_missed",
        limit=0.0,
    ),
    Row(
        name="recording-training",
        row="inline training loop while it is recorded",
        budget="0.5 x without a recording",
        program="recording",
        measured="training_recorded",
        limit=(0.5, "training_alone"),
        at_least=True,
    ),
    Row(
        name="table-tennis",
        row="accelerated table-tennis environment, inline",
        budget="0.9 x the same steps in one process without o80",
        program="table-tennis",
        measured="steps_inline",
        limit=(0.9, "steps_plain"),
        at_least=True,
    ),
    Row(
        name="table-tennis-processes",
        row="the same, arm and twin as two processes",
        budget="0.6 x",
        program="table-tennis",
        measured="steps_processes",
        limit=(0.6, "steps_plain"),
        at_least=True,
    ),
)
