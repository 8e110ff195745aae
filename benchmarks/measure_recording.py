"""Processor time of a recorder.

A second process publishes rows of 512 bytes in 1, 4 and 16 segments, 1000 times a second each, with
a command for each of eight actuators in every iteration. The recorder writes a chunk every 0.1 s,
as in its first seconds; later it writes larger ones, which cost less a row.
"""

import select
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import o80
from o80.recording.recorder import Recorder
from sampling import rounds, sample

SEGMENTS = (1, 4, 16)
ACTUATORS = 8
SENSORS = np.dtype([("force", "f8", 34)])  # makes a row of 512 bytes
PERIOD = 1e-3  # [s]
SECONDS = 2.0  # of a measurement


def publish(count: int) -> None:
    """Publishes until its input ends."""
    random = np.random.default_rng(1)
    values = random.standard_normal((997, 42))
    names = [f"bench-recording-{i}" for i in range(count)]
    backends = [
        o80.Backend(name, ACTUATORS, extended=SENSORS, frequency=1 / PERIOD, history=4000)
        for name in names
    ]
    for backend in backends:
        backend.publish(values[0, :8], {"force": values[0, 8:]})
    frontends = [o80.Frontend(name) for name in names]
    print("ready", flush=True)
    begin, i = time.monotonic(), 0
    while not select.select([sys.stdin], [], [], 0)[0]:
        i += 1
        for k, (backend, frontend) in enumerate(zip(backends, frontends, strict=True)):
            row = values[(i + 59 * k) % len(values)]
            frontend.add_command(None, row[:8])
            frontend.pulse()
            backend.step()
            backend.publish(row[:8], {"force": row[8:]})
        time.sleep(max(0.0, begin + i * PERIOD - time.monotonic()))


def measure_recorder(count: int, folder: Path) -> int:
    """Processor time of a recorder of so many segments. Returns how many rows it missed."""
    command = [sys.executable, __file__, "publish", str(count)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as publisher:
        assert publisher.stdin is not None
        assert publisher.stdout is not None
        publisher.stdout.readline()
        names = [f"bench-recording-{i}" for i in range(count)]
        recorder = Recorder(folder / f"{count}.mcap", names)
        frontends = [each.frontend for each in recorder.sources.values()]
        assert all(each is not None and each._layout.size == 512 for each in frontends)
        poll_for(recorder, 0.3)  # warms up
        rows, begin = recorder.rows, time.process_time()
        poll_for(recorder, SECONDS)
        used, rows = time.process_time() - begin, recorder.rows - rows
        missed = recorder.missed
        recorder.finish()
        publisher.stdin.close()
    (folder / f"{count}.mcap").unlink()
    # a busy machine publishes less: as if there had been 1000 rows a second
    sample(f"recording_{count}", "%", 100 * used * (count / PERIOD) / rows)
    return missed


def poll_for(recorder: Recorder, seconds: float) -> None:
    """As o80 record does in its first seconds."""
    end = time.monotonic() + seconds
    while (now := time.monotonic()) < end:
        recorder.poll()
        time.sleep(max(0.0, now + recorder.between_chunks - time.monotonic()))


def main() -> None:
    if sys.argv[1] == "publish":
        publish(int(sys.argv[2]))
        return
    with tempfile.TemporaryDirectory() as folder:
        missed = 0
        for _ in range(min(rounds(), 5)):
            missed += sum(measure_recorder(count, Path(folder)) for count in SEGMENTS)
        sample("recording_missed", "rows", missed)  # once: a median would hide a loss


if __name__ == "__main__":
    main()
