"""Differences between a recorded run and its replay."""

from typing import Any

from o80.base.machine import Machine, this_machine
from o80.rows.provenance import Provenance

TOLERANCE = 1e-9  #: largest difference that counts as equal where bits need not agree


def reads_the_world(schema: dict[str, Any]) -> str:
    """Returns why a replay must not start the robot (it may be hardware), or an empty string."""
    if schema.get("simulated"):
        return ""
    return (
        "the robot may be hardware: its driver does not declare that it is simulated (in "
        "describe: schema.simulated(), in Python: simulated = True)"
    )


def changes(recorded: Provenance, now: Provenance) -> list[str]:
    """Returns texts about changed files that may explain a difference between run and replay."""
    found = []
    if recorded.library_sha256 and recorded.library_sha256 != now.library_sha256:
        ran = "" if recorded.library == now.library else f" (it ran from {recorded.library!r})"
        found.append(f"the library of the robot has changed since: {now.library}{ran}")
    before = {(file.option, file.path): file.sha256 for file in recorded.files}
    found += [
        f"the file of the option {file.option} has changed since: {file.path}"
        for file in now.files
        if before.get((file.option, file.path), file.sha256) != file.sha256
    ]
    return found


def other_arithmetic(recorded: Provenance, now: Provenance, machine: Machine) -> str:
    """Returns why last bits of rows may differ without a fault; empty if they must agree.

    machine: the computer that recorded the run.
    """
    if recorded.version != now.version:
        return f"o80 {recorded.version} recorded it, this is {now.version}"
    if recorded.source_hash != now.source_hash:
        return (
            f"another build of o80 {now.version} recorded it (sources {recorded.source_hash[:12]}, "
            f"these are {now.source_hash[:12]})"
        )
    return machine.difference(this_machine())
