"""Report of the doctor: verdict, findings sorted by weight, what was measured and not read."""

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from o80.robots.doctor.check import MATTERS, Evidence, Finding
from o80.robots.doctor.checks import CHECKS
from o80.robots.doctor.computer import Computer
from o80.robots.doctor.wake_ups import WakeUps


@dataclass(frozen=True)
class Report:
    """Answer to the question whether a computer can serve a robot at a frequency."""

    frequency: float
    findings: tuple[Finding, ...]  #: remarks last, else by their delay
    measured: WakeUps | None
    unread: dict[str, str]  #: path and reason
    computer: dict[str, Any]

    @property
    def culprits(self) -> list[Finding]:
        """Findings that count."""
        return [finding for finding in self.findings if not finding.remark]

    @property
    def serves(self) -> bool:
        """Whether nothing is in the way, and no period was missed while it was measured."""
        measured = self.measured
        held = measured is None or (not measured.failed and measured.overruns == 0)
        return held and not self.culprits

    @property
    def verdict(self) -> str:
        """One sentence."""
        rate = f"{self.frequency:g} Hz"
        culprits = self.culprits
        if culprits:
            worst = culprits[0]
            count = f"{len(culprits)} causes, first" if len(culprits) > 1 else "because of"
            if worst.delay * self.frequency >= 1:
                return (
                    f"This computer will miss periods of a robot at {rate}: {count} the "
                    f"{worst.name}."
                )
            return (
                f"This computer can serve a robot at {rate}, but iterations will be up to "
                f"{time_text(worst.delay)} late: {count} the {worst.name}."
            )
        if self.measured is not None and self.measured.failed:
            return f"A robot could not be started on this computer: {self.measured.failed}"
        if self.measured is not None and self.measured.overruns:
            return (
                f"This computer did not finish {self.measured.overruns} of "
                f"{self.measured.iterations} iterations in time at {rate}, and no cause was found: "
                "hwlatdetect and cyclictest of rt-tests look further."
            )
        known = ", as far as could be read" if self.unread else ""
        return f"This computer can serve a robot at {rate}{known}."

    def as_dict(self) -> dict[str, Any]:
        """For JSON: see docs/real_time.md."""
        return {
            "serves": self.serves,
            "verdict": self.verdict,
            "frequency": self.frequency,
            "findings": [asdict(finding) for finding in self.findings],
            "measured": self.measured and self.measured.as_dict(),
            "unread": self.unread,
            "computer": self.computer,
        }


Measure = Callable[[Computer], WakeUps | None]


def examine(computer: Computer, frequency: float, measure: Measure) -> Report:
    """Looks at a computer, before and after a measurement; None: it was not measured."""
    before = computer.sample()
    measured = measure(computer)
    after = computer.sample()
    refused = () if measured is None else measured.refused
    evidence = Evidence(computer, frequency, before, after, refused, free_memory(computer))
    found = [finding for check in CHECKS for finding in check.look(evidence)]
    # nothing that does not matter at this rate
    found = [finding for finding in found if finding.delay * frequency >= MATTERS]
    found.sort(key=lambda finding: (finding.remark, -finding.delay))
    kind = about(computer)  # reads files too
    return Report(frequency, tuple(found), measured, dict(computer.unread), kind)


def free_memory(computer: Computer) -> int | None:
    """Free bytes of /dev/shm; None: this is a recorded computer."""
    if str(computer.root) != "/":
        return None
    try:
        found = os.statvfs("/dev/shm")
    except OSError:
        return None
    return found.f_bavail * found.f_frsize


def about(computer: Computer) -> dict[str, Any]:
    """Kind of computer."""
    return {
        "system": computer.release.get("PRETTY_NAME", ""),
        "kernel": computer.kernel,
        "processors": computer.processors,
        "isolated": computer.isolated,
        "virtual_machine": computer.virtual_machine,
        "container": computer.container,
    }


def time_text(seconds: float) -> str:
    """Time with its unit: "0.5 ms"."""
    return f"{seconds * 1e3:g} ms" if seconds >= 1e-3 else f"{seconds * 1e6:.0f} us"
