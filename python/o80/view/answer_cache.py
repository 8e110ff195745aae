"""Answers that several pages share for a moment."""

import threading
import time
from collections.abc import Callable, Hashable
from typing import Any

SHARED_FOR = 0.08  # [s], less than the time between two requests of a page
LOAD = 10.0  # an answer that took long is kept this many times as long
MOST = 64


class Kept:
    """Answers by what was asked. Many pages, long rows and long windows cost at most a tenth of a
    processor, because what took long is kept longer."""

    def __init__(self) -> None:
        self._answers: dict[Hashable, tuple[float, Any]] = {}
        self._lock = threading.Lock()

    def get(self, asked: Hashable, work: Callable[[], Any]) -> Any:
        """The answer of `work`, or the one that another page has just got."""
        with self._lock:
            begin = time.monotonic()
            until, answer = self._answers.get(asked, (0.0, None))
            if begin < until:
                return answer
            answer = work()
            end = time.monotonic()
            if len(self._answers) >= MOST:
                self._answers = {key: kept for key, kept in self._answers.items() if kept[0] > end}
            self._answers[asked] = end + max(SHARED_FOR, LOAD * (end - begin)), answer
            return answer
