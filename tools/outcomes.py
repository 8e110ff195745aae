"""Reads reports of test runners: passed, failed and skipped tests, with reasons of skips.

ctest and the real-time machine both name a test `folder.Suite.Test`: a test that is skipped in
one build and passes in another one has the same name in both.
"""

import re
import xml.etree.ElementTree as ET
from pathlib import Path


class Outcomes:
    """Merged outcomes of several runs."""

    def __init__(self) -> None:
        self.passed: set[str] = set()
        self.skipped: dict[str, str] = {}  # reasons by name
        self.failed: list[str] = []

    def read_report(self, file: Path) -> None:
        """Adds a report of ctest, of pytest, or of a C++ test program with the report's name."""
        for case in ET.parse(file).getroot().iter("testcase"):
            name = case.get("name", "")
            of_ctest, of_program = case.get("status"), case.get("result")
            if of_program or not of_ctest:
                name = f"{case.get('classname')}.{name}"
            if of_program:
                name = f"{file.stem}.{name}"
            skipped = case.find("skipped")
            if skipped is not None:
                reason = skipped.get("message", "")
                if of_program:
                    reason = " ".join(reason.split()[1:])  # drops file and line
                elif of_ctest:
                    reason = _googletest_reason(case.findtext("system-out") or "")
                self.skipped[name] = reason
            elif all(case.find(kind) is None for kind in ("failure", "error")):
                self.passed.add(name)
            else:
                self.failed.append(name)

    def read_log(self, step: str, log: Path) -> bool:
        """Adds a skipped step if its log has a line `skipped: why`; returns whether it does."""
        match = re.search(r"^skipped: (.*)", log.read_text(errors="replace"), re.MULTILINE)
        if match:
            self.skipped[step] = match[1]
        return match is not None

    def left_out(self) -> dict[str, str]:
        """Returns the tests that were skipped and passed in no run, with the reasons."""
        return {name: why for name, why in self.skipped.items() if name not in self.passed}

    def gaps(self) -> list[str]:
        """Returns those of them that no command on demand runs either."""
        return [
            name for name, why in self.left_out().items() if not why.endswith("make rt runs it")
        ]

    def tell(self) -> None:
        for name, why in self.left_out().items():
            print(f"skipped: {name}: {why}")


def _googletest_reason(printed: str) -> str:
    match = re.search(r": Skipped\n(.*(?:\n(?!\n|\[).*)*)", printed)
    return " ".join(match[1].split()) if match else "it does not say why"
