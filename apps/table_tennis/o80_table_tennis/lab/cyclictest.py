"""cyclictest of rt-tests beside the lab: how late this machine wakes a thread without o80."""

from __future__ import annotations

import contextlib
import re
import shutil
import signal
import subprocess
from types import TracebackType
from typing import Any, Self

COMMAND = ("cyclictest", "-q", "-m", "-t1", "-p79", "-i2000")
"""One thread below the arm's priority, which wakes as often as the arm does."""
ENDS_WITHIN = 5.0
"""[s]"""
RESULT = re.compile(r"Min:\s*(\d+).*Avg:\s*(\d+).*Max:\s*(\d+)")


class Cyclictest:
    """Runs while the `with` block does; then `result` holds its numbers, or why there are none."""

    def __init__(self, *, enabled: bool = True) -> None:
        self.result: dict[str, Any] = {"why_not": "was not asked for"}
        self._enabled = enabled
        self._popen: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        if not self._enabled:
            return self
        if shutil.which(COMMAND[0]) is None:
            self.result = {"why_not": "is not installed: apt-get install rt-tests"}
            return self
        self._popen = subprocess.Popen(
            COMMAND,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            process_group=0,
        )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._popen is None:
            return
        with contextlib.suppress(ProcessLookupError):
            self._popen.send_signal(signal.SIGINT)
        try:
            printed, _ = self._popen.communicate(timeout=ENDS_WITHIN)
        except subprocess.TimeoutExpired:
            self._popen.kill()
            printed, _ = self._popen.communicate()
        found = RESULT.search(printed)
        if found is None:
            self.result = {"why_not": printed.strip() or "it printed nothing"}
        else:
            least, mean, most = (int(number) for number in found.groups())
            self.result = {
                "command": " ".join(COMMAND),
                "wake_up_us": {"least": least, "mean": mean, "most": most},
            }
