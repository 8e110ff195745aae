"""A recording of 48 hours: memory of its recorder, and how soon its last minute is read.

A second process publishes rows of four robots in simulated time, 2.5 s apart as chunks are. So the
file has as many chunks and channels as one of days, but few rows.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import o80
from o80.cli.plot import plot
from o80.recording.recorder import LONGEST_CHUNK, Recorder
from sampling import sample, seconds

ROBOTS = 4
CHUNKS = int(48 * 3600 / LONGEST_CHUNK)
JOINT = np.dtype([("position", "f8")])


def publish(names: list[str]) -> None:
    """Publishes a row of each robot for each line of its input."""
    robots = [
        o80.Backend(
            name, {"arm": (JOINT, 2)}, frequency=1 / LONGEST_CHUNK, bursting=True, history=100
        )
        for name in names
    ]
    for robot in robots:
        robot.publish()
    frontends = [o80.Frontend(name) for name in names]
    print(flush=True)
    for chunk, _ in enumerate(sys.stdin):
        for robot, frontend in zip(robots, frontends, strict=True):
            if chunk % 10 == 0:
                frontend.add_command(0, 0.1 * (chunk % 7), iterations=5)
            frontend.burst(1, wait=False)
            robot.publish({"arm": robot.step()})
        print(flush=True)


def memory() -> float:
    """Memory of this process, without that of segments [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    values = {line.split(":")[0]: line.split()[1] for line in lines if line.endswith(" kB")}
    return (int(values["VmRSS"]) - int(values["RssShmem"])) / 1000


def record(path: Path, names: list[str]) -> float:
    """Returns the memory at the end [MB]."""
    command = [sys.executable, __file__, "publish", *names]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, bufsize=0) as robots:
        assert robots.stdin is not None
        assert robots.stdout is not None
        robots.stdout.readline()
        recorder = Recorder(path, names)
        for _ in range(CHUNKS):
            robots.stdin.write(b"\n")
            robots.stdout.read(1)
            recorder.poll()
        recorder.finish()
        robots.stdin.close()
    assert recorder.missed == 0
    return memory()


def main() -> None:
    if sys.argv[1] == "publish":
        publish(sys.argv[2:])
        return
    names = [f"bench-days-{os.getpid()}-{i}" for i in range(ROBOTS)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "days.mcap"
        sample("recording_days_memory", "MB", record(path, names))
        sample("recording_days_size", "MB", path.stat().st_size / 1e6)
        for _ in range(3):
            sample("recording_days_open", "s", seconds(lambda: o80.open(path)))
            read = seconds(lambda: o80.open(path)[names[0]].history(seconds=60))
            sample("recording_days_read", "s", read)
        import matplotlib.pyplot  # noqa: F401  is not measured

        sys.stdout = sys.stderr
        shown = seconds(lambda: plot([str(path)], Path(folder) / "days.png", seconds=60))
        sys.stdout = sys.__stdout__
        sample("recording_days_plot", "s", shown)


if __name__ == "__main__":
    main()
