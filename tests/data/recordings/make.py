"""Makes format_1.mcap: `python tests/data/recordings/make.py`, after a change of the format.

The file stays as it is when o80 changes, so that later versions must read what this one wrote. A
change of the format gets a file of its own. format_1.json says what must be found in it.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import o80
from o80.recording.recorder import Recorder

HERE = Path(__file__).parent
FORMAT = "format_1"
SEGMENT = "joints"


def play(arm: o80.Frontend, recorder: Recorder, seed: int) -> None:
    """A little of everything that a journal tells."""
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
    arm.add_command("shoulder", 1.0, iterations=50)
    arm.burst(5)
    arm.halt("an example")
    arm.burst(3)
    arm.resume()
    arm.purge()
    arm.burst(3)


def found_in(path: Path) -> dict[str, Any]:
    """What every later version must find."""
    recording = o80.open(path)
    return {
        "marks": [{"name": mark.name, "values": dict(mark.values)} for mark in recording.marks],
        "epochs": [facts(epoch) for epoch in recording[SEGMENT].epochs],
    }


def facts(epoch: Any) -> dict[str, Any]:
    history = epoch.history()
    return {
        "iteration": history.iteration.tolist(),
        "time": history.time.tolist(),
        "desired": history.desired.tolist(),
        "observed": history.observed.tolist(),
        "effort": history.extended.effort.tolist(),
        "halted": history.halted.tolist(),
        "options": epoch.provenance.options,
        "journal": [
            [entry.number, entry.kind, entry.iteration, len(entry.commands), entry.text]
            for entry in epoch.journal()
        ],
    }


def main() -> None:
    path = HERE / f"{FORMAT}.mcap"
    path.unlink(missing_ok=True)
    # no path of the machine on which the file was made
    told: Any = o80.Frontend.provenance
    library = "/usr/lib/o80/robots/two_joints.so"
    o80.Frontend.provenance = property(  # type: ignore[assignment,method-assign]
        lambda self: replace(told.fget(self), library=library)
    )
    recorder = Recorder(path, [SEGMENT])
    for seed in (3, 5):
        with o80.robots.load("two_joints").inline(SEGMENT, gain=10.0 + seed) as arm:
            while recorder.sources[SEGMENT].newest != 0:
                recorder.catch_up()
            recorder.mark("episode", number=seed)
            play(arm, recorder, seed)
            recorder.catch_up()
        recorder.catch_up()
    recorder.finish()
    text = json.dumps(found_in(path))
    (HERE / f"{FORMAT}.json").write_text(text + "\n")
    print(f"{path.stat().st_size} bytes, {len(text)} bytes of JSON")


if __name__ == "__main__":
    main()
