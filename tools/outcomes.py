"""Reads reports of ctest and pytest: passed, failed and skipped tests, with reasons of skips.

The real-time machine names a test `folder.Suite.Test`, as ctest does.
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
        """Adds a report of ctest or pytest."""
        for case in ET.parse(file).getroot().iter("testcase"):
            of_ctest = "status" in case.attrib
            name = case.get("name", "")
            name = name if of_ctest else f"{case.get('classname')}.{name}"
            skipped = case.find("skipped")
            if skipped is not None:
                printed = case.findtext("system-out") or ""
                reason = _googletest_reason(printed) if of_ctest else skipped.get("message", "")
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
