"""Reports of test runners: which tests passed, and which were skipped for which reason.

ctest names a test `folder.Suite.Test`, and so does the real-time machine: a test that is skipped in
one build and passes in another one has the same name in both.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Outcomes:
    """Outcomes of one run, or of several together."""

    passed: set[str] = field(default_factory=set)
    skipped: dict[str, str] = field(default_factory=dict)  # by name: the reason

    def add(self, other: "Outcomes") -> None:
        self.passed |= other.passed
        self.skipped |= other.skipped

    def gaps(self) -> dict[str, str]:
        """Tests that were skipped and passed in no run, with the reasons."""
        return {name: why for name, why in self.skipped.items() if name not in self.passed}


def of_ctest(report: Path) -> Outcomes:
    """Reads what `ctest --output-junit` wrote."""
    found = Outcomes()
    for case in ET.parse(report).getroot().iter("testcase"):
        name = case.get("name", "")
        if case.get("status") == "run":
            found.passed.add(name)
        elif case.find("skipped") is not None:
            found.skipped[name] = _googletest_reason(case.findtext("system-out") or "")
    return found


def _googletest_reason(printed: str) -> str:
    said = re.search(r": Skipped\n(.*(?:\n(?!\n|\[).*)*)", printed)
    return " ".join(said[1].split()) if said else "it does not say why"


def of_pytest(report: Path) -> Outcomes:
    """Reads what `pytest --junit-xml` wrote."""
    found = Outcomes()
    for case in ET.parse(report).getroot().iter("testcase"):
        name = f"{case.get('classname')}.{case.get('name')}"
        skipped = case.find("skipped")
        if skipped is not None:
            found.skipped[name] = skipped.get("message", "")
        elif case.find("failure") is None and case.find("error") is None:
            found.passed.add(name)
    return found


def of_real_time_machine(passed: Path) -> Outcomes:
    """Reads the list of the tests that passed there, one a line."""
    return Outcomes(passed=set(passed.read_text().split()))


def of_log(step: str, log: Path) -> Outcomes:
    """Outcome of a step that says itself in a line `skipped: why` that it could not be run."""
    lines: Iterable[str] = log.read_text(errors="replace").splitlines()
    reasons = [line.removeprefix("skipped: ") for line in lines if line.startswith("skipped: ")]
    return Outcomes(skipped={step: reasons[-1]} if reasons else {})
