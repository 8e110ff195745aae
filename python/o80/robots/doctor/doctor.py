"""Report of the doctor: verdict, sorted findings, measurements and unreadable files."""

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
    """Whether a computer can serve a robot at a frequency, with findings and measurements."""

    frequency: float
    findings: tuple[Finding, ...]  #: remarks last, else by their delay
    measured: WakeUps | None
    loaded: WakeUps | None  #: the same, beside a load
    unread: dict[str, str]  #: path and reason
    computer: dict[str, Any]

    @property
    def culprits(self) -> list[Finding]:
        """Findings that are no remarks."""
        return [finding for finding in self.findings if not finding.remark]

    @property
    def serves(self) -> bool:
        """True if there is no culprit, and no period was missed during the measurement."""
        failed = self.measured is not None and self.measured.failed
        return not failed and not self._missed and not self.culprits

    @property
    def _missed(self) -> str:
        """Part of a sentence about missed periods, first those without a load; empty: none."""
        for measured, beside in ((self.measured, ""), (self.loaded, " beside a load")):
            if measured is not None and measured.overruns:
                return (
                    f"did not finish {measured.overruns} of {measured.iterations} iterations in "
                    f"time at {self.frequency:g} Hz{beside}"
                )
        return ""

    @property
    def verdict(self) -> str:
        """The verdict in one sentence."""
        rate = f"{self.frequency:g} Hz"
        culprits = self.culprits
        if self.measured is not None and self.measured.failed:
            return f"A robot could not be measured on this computer: {self.measured.failed}"
        if culprits:
            worst = culprits[0]
            count = f"{len(culprits)} causes, first" if len(culprits) > 1 else "because of"
            if worst.delay * self.frequency >= 1:
                what = f"will miss periods of a robot at {rate}"
            else:
                what = self._missed or (
                    f"can serve a robot at {rate}, but iterations will be up to "
                    f"{time_text(worst.delay)} late"
                )
            return f"This computer {what}: {count} the {worst.name}."
        if self._missed:
            return (
                f"This computer {self._missed}, and no cause was found: "
                "hwlatdetect and cyclictest of rt-tests look further."
            )
        known = ", as far as could be read" if self.unread else ""
        return f"This computer can serve a robot at {rate}{known}."

    def as_dict(self) -> dict[str, Any]:
        """Converts to JSON: see docs/real_time.md."""
        return {
            "serves": self.serves,
            "verdict": self.verdict,
            "frequency": self.frequency,
            "findings": [asdict(finding) for finding in self.findings],
            "measured": self.measured and asdict(self.measured),
            "loaded": self.loaded and asdict(self.loaded),
            "unread": self.unread,
            "computer": self.computer,
        }


Measure = Callable[[Computer], WakeUps | None]


def examine(
    computer: Computer, frequency: float, measure: Measure, measure_loaded: Measure
) -> Report:
    """Samples a computer before and after a measurement, then measures beside a load.

    measure: returns None for a computer that is not measured.
    """
    before = computer.sample()
    measured = measure(computer)
    after = computer.sample()
    loaded = None if measured is None or measured.failed else measure_loaded(computer)
    refused = () if measured is None else measured.refused
    evidence = Evidence(computer, frequency, before, after, refused, free_memory(computer))
    found = [finding for check in CHECKS for finding in check.look(evidence)]
    # drop delays that do not matter at this rate
    found = [finding for finding in found if finding.delay * frequency >= MATTERS]
    found.sort(key=lambda finding: (finding.remark, -finding.delay))
    kind = about(computer)  # reads files too
    return Report(frequency, tuple(found), measured, loaded, dict(computer.unread), kind)


def free_memory(computer: Computer) -> int | None:
    """Returns free bytes of /dev/shm; None for a recorded computer."""
    if str(computer.root) != "/":
        return None
    try:
        found = os.statvfs("/dev/shm")
    except OSError:
        return None
    return found.f_bavail * found.f_frsize


def about(computer: Computer) -> dict[str, Any]:
    """Describes the computer."""
    return {
        "system": computer.release.get("PRETTY_NAME", ""),
        "kernel": computer.kernel,
        "processors": computer.processors,
        "isolated": computer.isolated,
        "virtual_machine": computer.virtual_machine,
        "container": computer.container,
    }


def time_text(seconds: float) -> str:
    """Formats a time with its unit: "0.5 ms"."""
    return f"{seconds * 1e3:g} ms" if seconds >= 1e-3 else f"{seconds * 1e6:.0f} us"
