"""Remembers which steps passed on exactly the files of the checkout."""

import hashlib
import json
import subprocess
from pathlib import Path

from sources import ROOT

MADE = {".git", ".venv", "build", "__pycache__"}  # folders that hold no sources


def files() -> list[Path]:
    """All files but those that git ignores; without git, those outside of MADE."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    try:
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        everything = (file for file in ROOT.rglob("*") if file.is_file())
        return sorted(f for f in everything if not MADE & set(f.relative_to(ROOT).parts))
    names = sorted(set(listed.stdout.split("\0")) - {""})
    return [ROOT / name for name in names if (ROOT / name).is_file()]


def digest() -> str:
    """Digest of the paths and contents of all files."""
    total = hashlib.sha256()
    for file in files():
        content = hashlib.sha256(file.read_bytes()).hexdigest()
        total.update(f"{file.relative_to(ROOT)}\0{content}\n".encode())
    return total.hexdigest()


class PassedSteps:
    """A file with the names of steps, and the digest of the files on which each passed last."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._now = digest()

    def _read(self) -> dict[str, str]:
        try:
            found = json.loads(self._file.read_text())
        except (OSError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}

    def contains(self, step: str) -> bool:
        """Whether the step passed on the present files."""
        return self._read().get(step) == self._now

    def forget(self, step: str) -> None:
        self._file.write_text(json.dumps({k: v for k, v in self._read().items() if k != step}))

    def add(self, step: str) -> None:
        """Unless a file changed since the steps began."""
        if digest() == self._now:
            self._file.write_text(json.dumps(self._read() | {step: self._now}))
