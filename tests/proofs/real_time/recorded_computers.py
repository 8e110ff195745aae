"""Recorded computers: files of /proc and /sys, unpacked into a folder for the doctor to read."""

import re
from pathlib import Path

from checkout import ROOT
from o80.robots.doctor.computer import Computer
from o80.robots.doctor.doctor import Report, examine
from o80.robots.doctor.wake_ups import WakeUps

FOLDER = ROOT / "tests/python/computers"
SECTION = re.compile(r"^(---|\+\+\+) (\S+)\n", re.MULTILINE)


def unpacked(text: str, mark: str) -> dict[str, str]:
    """Path and content of each section: "---" before the measurement, "+++" after it."""
    _, *parts = SECTION.split(text)
    sections = zip(parts[::3], parts[1::3], parts[2::3], strict=True)
    return {path: content for found, path, content in sections if found == mark}


class RecordedComputer:
    """A computer below `root`, as its text says."""

    def __init__(self, root: Path, text: str) -> None:
        self.root = root
        self.before = unpacked(text, "---")
        self.later = unpacked(text, "+++")

    def change(self, path: str, content: str | None, later: str | None = None) -> None:
        """Gives a file another content; None: it is not there."""
        self.later.pop(path, None)
        self.before.pop(path, None)
        if content is not None:
            self.before[path] = content
        if later is not None:
            self.later[path] = later

    def write(self, files: dict[str, str]) -> None:
        for path, content in files.items():
            file = self.root / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(content)

    def examine(
        self, frequency: float, measured: WakeUps | None = None, loaded: WakeUps | None = None
    ) -> Report:
        """Report of the doctor; the measurements take no time, the first gives the later files."""
        self.write(self.before)

        def measure(_: Computer) -> WakeUps | None:
            self.write(self.later)
            return measured

        return examine(Computer(self.root), frequency, measure, lambda _: loaded)


def recorded(name: str, root: Path) -> RecordedComputer:
    """A computer of tests/python/computers."""
    return RecordedComputer(root, (FOLDER / f"{name}.txt").read_text())
