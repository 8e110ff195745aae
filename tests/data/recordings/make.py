"""Makes a recording of the present format: `make.py codec_1` or `make.py kinds_1`, in this folder.

The files stay as they are when o80 changes, so that later versions must read what this one wrote. A
change of the format gets a file of its own. The JSON beside a file says what must be found in it.

codec_1.mcap: journal in version 1
kinds_1.mcap: fields of each kind, in a folder of several files, without compression
"""

import dataclasses
import hashlib
import json
import subprocess
import sys
from dataclasses import replace
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

import o80
from o80 import _core
from o80.recording.file_writer import Form
from o80.recording.reader import files_of
from o80.recording.recorder import Recorder

HERE = Path(__file__).parent
SEGMENT, BENCH, KINDS = "joints", "bench", "kinds"
MAX_NUMBERS = 16

# ---------------------------------------------------------------------------- what is played


def play(arm: o80.Frontend, recorder: Recorder, seed: int) -> None:
    """A little of everything that a simulation does in bursts."""
    arm.request("reset", seed=seed)
    recorder.catch_up()
    arm.add_command(["shoulder", "elbow"], [0.5, -0.25], iterations=20, profile="minimum_jerk")
    arm.burst(10)
    arm.add_command("elbow", 1.0, speed=20.0, mode="overwrite")
    arm.add_command("elbow", 0.0, duration=0.02)
    arm.burst(30)
    arm.add_trajectory([[0.0, 0.0], [0.1, 0.2], [0.3, -0.1]], iterations=5)
    arm.pulse_and_wait()
    recorder.catch_up()
    # chunks: the second answer takes over from the first
    for profile in ("smooth", "monotone"):
        with arm.chunks("elbow", step=5, profile=profile) as plan:
            for rows in ([0.1, 0.2, 0.1, 0.0], [0.15, 0.1, 0.05]):
                plan.send(rows, seen=arm.latest())
                arm.burst(7)
    recorder.catch_up()
    arm.add_command("shoulder", 1.0, iterations=50)
    arm.burst(5)
    arm.halt("an example")
    arm.burst(3)
    arm.resume()
    arm.purge()
    arm.burst(3)


def play_two_runs(recorder: Recorder) -> None:
    for seed in (3, 5):
        with o80.robots.load("two_joints").inline(SEGMENT, gain=10.0 + seed) as arm:
            while recorder.sources[SEGMENT].newest != 0:
                recorder.catch_up()
            recorder.mark("episode", number=seed)
            play(arm, recorder, seed)
            if seed == 3:
                arm.request("snapshot", slot=2)
            recorder.catch_up()
        recorder.catch_up()


class Bench:
    """A backend in this program that is stepped by hand."""

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self.backend = o80.Backend(
            BENCH,
            {
                "joint": ({"position": float, "velocity": float}, ["shoulder", "elbow"]),
                "finger": float,
                "grip": bool,
            },
            limits={
                "shoulder": {"position": (-1.0, 1.0, 2.0, 20.0, 400.0)},
                "elbow": {"position": (-1.0, 1.0, 2.0, 20.0, 400.0)},
                "finger": (-1.0, 1.0, 50.0),
            },
            requests={"home": {"speed": float, "axis": int}, "refuse": None},
            frequency=500.0,
            silence=60,
            stale="purge",
        )
        self.backend.on("home", lambda _: None)
        self.backend.on("refuse", self.refuse)
        self.publish()
        while recorder.sources[BENCH].newest != 0:
            recorder.catch_up()

    @staticmethod
    def refuse(_: Any) -> None:
        raise o80.RequestRejected("an example")

    def publish(self) -> None:
        self.backend.publish()
        self.recorder.catch_up()

    def run(self, iterations: int) -> None:
        for _ in range(iterations):
            desired = self.backend.step()
            assert desired is not None
            self.backend.publish({name: desired[name] for name in ("joint", "finger", "grip")})
        self.recorder.catch_up()

    def run_until(self, kind: str) -> None:
        """Until the journal has an entry of this kind."""
        with o80.Frontend(BENCH, read_only=True) as observer:
            for _ in range(10_000):
                self.run(1)
                if any(entry.kind == kind for entry in observer.journal()):
                    return
        raise RuntimeError(f"the journal has no '{kind}'")


def play_bench(recorder: Recorder) -> None:
    """Every pace, profile, mode and start, and what else a journal tells."""
    bench = Bench(recorder)
    with o80.Frontend(BENCH) as arm, o80.Frontend(BENCH) as other:
        # commands
        arm.add_command("finger", 0.0625)
        arm.add_command("shoulder", {"position": 0.25}, duration=0.05)
        arm.add_command("elbow", {"position": 0.25}, fastest=True)
        arm.add_command("grip", True)
        arm.pulse()
        bench.run(40)
        arm.add_command("shoulder", {"velocity": 0.5}, iterations=7, profile="linear")
        arm.add_command("elbow", {"position": 0.0, "velocity": 0.0}, speed=1.0, start="observed")
        arm.add_command("finger", -0.5, until=arm.published + 20, profile="minimum_jerk")
        arm.pulse()
        bench.run(5)
        arm.add_command("finger", 0.75, iterations=3, mode="overwrite")
        arm.add_command(
            ["shoulder", "elbow"], [{"position": 0.5}, {"position": -0.5}], duration=0.1
        )
        arm.pulse()
        bench.run(60)
        arm.add_command("finger", -1.0)  # too far for its iteration
        arm.pulse()
        bench.run(3)
        # trajectories: the last one is copied over several iterations
        arm.add_trajectory([0.1, 0.2, 0.0], "finger", times=[0.01, 0.02, 0.03])
        arm.add_trajectory([True, False], "grip", iterations=2)
        arm.pulse()
        bench.run(20)
        ramp = np.linspace(0.0, 0.1, 3000)
        rows = {"position": np.stack([ramp, -ramp], 1), "velocity": np.zeros((3000, 2))}
        arm.add_trajectory(rows, ["shoulder", "elbow"], times=np.arange(1, 3001) * 2e-3)
        arm.pulse()
        bench.run(40)
        # purges, requests, interrupts
        arm.add_command("finger", 0.5, iterations=30)
        arm.add_command("finger", 0.6, iterations=30)
        arm.pulse()
        bench.run(3)
        arm.purge("finger")
        arm._purge_own()
        arm.add_purge()
        arm.add_request("home", speed=0.5, axis=2)
        arm.add_request("refuse")
        arm.pulse()
        bench.run(2)
        arm.add_command("finger", 0.9, iterations=30)
        arm.pulse()
        bench.run(2)
        bench.backend.interrupt("finger")
        bench.run(2)
        # batches for later, too late, and under the control of another one
        arm.add_command("finger", 0.3, iterations=2)
        arm.pulse(at=arm.published + 5)
        arm.add_command("finger", 0.4, iterations=2)
        arm.pulse(at=1)
        arm.add_command("finger", 0.5, iterations=2)
        arm.pulse(at=1, late="now")
        arm.add_command("finger", 0.5, until=2)
        arm.pulse()
        bench.run(8)
        arm._take_control()
        bench.run(1)
        other.add_command("finger", 0.1, iterations=2)
        other.pulse()
        bench.run(2)
        arm._release_control()
        arm.pulse()
        bench.run(2)
        # a commander that gives no sign of life, and loses control with it
        other._take_control()
        other.add_command("finger", -0.9, iterations=500)
        other.pulse()
        bench.run_until("silent")
        # a halt, while something moves
        arm.add_command("shoulder", {"position": -0.5}, duration=0.2)
        arm.pulse()
        bench.run(20)
        bench.backend.halt("a switch")
        bench.run(30)
        arm.add_command("finger", 0.0)
        arm.pulse()
        bench.run(2)
    # a commander that dies
    child = subprocess.Popen(
        [sys.executable, "-c", DIES], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "sent\n"
    bench.run(1)
    child.kill()
    child.wait()
    bench.run_until("died")
    bench.backend.close("the cable is broken")
    recorder.catch_up()


DIES = f"""
import o80
arm = o80.Frontend({BENCH!r})
arm._take_control()
print('sent', flush=True)
input()
"""


class Tool(IntEnum):
    NONE = 0
    BRUSH = 3
    HOOK = -2


def record_kinds(path: Path) -> None:
    """Fields of each kind, alone, in arrays and in structs, with padding between them."""
    dtypes = ["?", "i1", "u8", "i2", "f4", "u1", "i8", "u2", "f8", "i4", "u4"]
    cell = np.dtype([("on", "?"), ("force", "f8"), ("mode", "i2", (2,))])
    sensors: dict[str, Any] = {f"n_{kind.replace('?', 'b')}": np.dtype(kind) for kind in dtypes}
    sensors |= {"tool": Tool, "grid": ("f4", (2, 3)), "cells": (cell, (2,))}
    hand = {"position": float, "tool": Tool, "inner": {"steps": np.int32, "force": np.float32}}
    groups = {"wrist": (float, ["roll", "pitch"]), "hand": hand, "valve": bool, "tool": Tool}
    with o80.Backend(KINDS, groups, extended=sensors, frequency=500.0) as backend:
        backend.publish()
        with o80.Frontend(KINDS) as arm:
            recorder = Recorder(path, [KINDS], split="8k", form=Form(compression="none"))
            while recorder.sources[KINDS].newest != 0:
                recorder.catch_up()
            arm.add_command("roll", 0.5, iterations=20)
            arm.add_command("hand", {"position": 0.25, "tool": Tool.HOOK}, iterations=9)
            arm.add_command("valve", True)
            arm.add_command("tool", Tool.BRUSH)
            arm.pulse()
            for i in range(1, 61):
                values: dict[str, Any] = {}
                for name, kind in list(sensors.items())[: len(dtypes)]:
                    values[name] = i % 2 == 1 if kind.kind == "b" else kind.type(i)
                values["tool"] = list(Tool)[i % 3]
                values["grid"] = np.arange(6, dtype="f4").reshape(2, 3) + i
                values["cells"] = np.array([(i % 2, i, (i, -i)), (1, -i, (3, 4))], cell)
                desired = backend.step()
                assert desired is not None
                backend.publish({name: desired[name] for name in groups}, values)
                if i % 30 == 0:  # a file each
                    recorder.poll()
            recorder.finish()


# ---------------------------------------------------------------------------- what must be found


def journal_facts(value: Any) -> Any:
    """An entry of a journal for JSON: what differs from the defaults of its fields."""
    if dataclasses.is_dataclass(value):
        return {
            field.name: journal_facts(getattr(value, field.name))
            for field in dataclasses.fields(value)
            if not _is_default(getattr(value, field.name), field.default)
        }
    if isinstance(value, dict):
        return {name: journal_facts(each) for name, each in value.items()}
    if isinstance(value, tuple):
        return [journal_facts(each) for each in value]
    if isinstance(value, np.ndarray) and value.size > MAX_NUMBERS:
        return [str(value.dtype), list(value.shape), hashlib.sha256(value.tobytes()).hexdigest()]
    if isinstance(value, _core.Seen):
        return repr(value)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _is_default(found: Any, default: Any) -> bool:
    return found is default or (isinstance(default, (str, int, tuple)) and found == default)


def found_in(path: Path) -> dict[str, Any]:
    """Contents that every later version must find."""
    recording = o80.open(path)
    assert recording.finished
    return {
        "marks": [{"name": mark.name, "values": dict(mark.values)} for mark in recording.marks],
        "segments": {
            name: [facts(epoch) for epoch in segment.epochs]
            for name, segment in recording.segments.items()
        },
    }


def facts(epoch: Any) -> dict[str, Any]:
    history = epoch.history()
    return {
        "rows": len(history),
        "first": int(history.iteration[0]),
        "sha256": {
            name: hashlib.sha256(_text_of(history.rows[name]).encode()).hexdigest()
            for name in history.rows.dtype.names
        },
        "gaps": [*epoch.gaps, *epoch.journal_gaps],
        "options": epoch.provenance.options,
        "journal": [journal_facts(entry) for entry in epoch.journal()],
    }


def _text_of(values: Any) -> str:
    return json.dumps(values.tolist(), default=lambda nested: nested.tolist())


def main() -> None:
    path = HERE / f"{sys.argv[1]}.mcap"
    # no path of the machine on which the file was made
    told: Any = o80.Frontend.provenance
    library = "/usr/lib/o80/robots/two_joints.so"
    o80.Frontend.provenance = property(  # type: ignore[assignment,method-assign]
        lambda self: replace(told.fget(self), library=library if self.segment == SEGMENT else "")
    )
    if path.stem.startswith(KINDS):
        record_kinds(path)
    else:
        recorder = Recorder(path, [SEGMENT, BENCH])
        play_two_runs(recorder)
        play_bench(recorder)
        recorder.finish()
    write_facts(path)


def write_facts(path: Path) -> None:
    text = json.dumps(found_in(path))
    path.with_suffix(".json").write_text(text + "\n")
    size = sum(file.stat().st_size for file in files_of(path))
    print(f"{size} bytes, {len(text)} bytes of JSON")


if __name__ == "__main__":
    main()
