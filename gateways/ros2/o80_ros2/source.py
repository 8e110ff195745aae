"""Publishes one segment, also after restarts of its backend."""

import o80
from o80.errors import Error
from o80_ros2.commands import Commands
from o80_ros2.ros import Shared
from o80_ros2.topics import Topics

BETWEEN_POLLS, EVERY_ROW = 0.5, 0.005
"""Intervals of attempts to attach, and of readings if every row is published [s]."""
MOST_ROWS, MOST_BYTES = 200, 4 << 20
"""Limits of one reading; further rows wait until the other robots were read."""
OK, WARN, ERROR, STALE = (bytes([level]) for level in range(4))


class Source:
    """Reads one segment and publishes its rows. Used by one thread, except for `refuse`."""

    def __init__(self, shared: Shared, segment: str) -> None:
        self.segment, self._shared = segment, shared
        self.name = shared.settings.robot(segment)  #: name in ROS
        self._log = shared.node.get_logger()
        self._frontend: o80.Frontend | None = None
        self.topics: Topics | None = None
        self._commands: Commands | None = None
        self._next = 0  # first unread iteration
        self._poll_at = 0.0
        self._problem = self._why = ""  # texts of the failed attachment, of the last refusal
        self.due = 0.0  #: time of the next reading [s]
        self.published = self.missed = self.late = self.refused = 0

    @property
    def gone(self) -> bool:
        """Whether the backend has ended, or never existed."""
        return self._frontend is None or not self._frontend.alive

    def refuse(self, what: str, why: object) -> None:
        """Reports a refused message or call."""
        self.refused += 1
        self._why = f"{what}: {why}"
        self._log.warning(f"'{self.segment}' refused {self._why}", throttle_duration_sec=1.0)

    def tick(self, now: float, usual: float) -> None:
        """Publishes new rows. now: [s]; usual: default rate [Hz]."""
        rates = self._shared.settings.rates
        rate = rates.get(self.segment, rates.get("", usual))
        period = 1.0 / rate if rate else EVERY_ROW
        left_out = int((now - self.due) / period) if self.due else 0
        self.due = (self.due or now) + (left_out + 1) * period
        if left_out and rate and not self.gone:  # with `all`, rows wait, and may be overwritten
            self.late += left_out
            text = f"behind: {self.late} periods of '{self.segment}' were left out so far"
            self._log.warning(f"{text}; a lower --rate helps", throttle_duration_sec=5.0)
        gone, robot = self.gone, self._frontend  # polled before the last rows are read
        self._publish(every=not rate)
        is_read = robot is None or robot.published < self._next
        if gone and is_read and now >= self._poll_at:
            self._poll_at = now + BETWEEN_POLLS
            if self._attach():
                self._publish(every=not rate)
                self.due = 0.0  # attaching is slow
        if self._commands is not None:
            self._commands.poll()

    def _publish(self, *, every: bool) -> None:
        robot = self._frontend
        if robot is None or self.topics is None or robot.published < self._next:
            return
        since = max(self._next, robot.oldest) if every else robot.published
        most = max(1, min(MOST_ROWS, MOST_BYTES // robot._layout.size)) if every else 1
        rows = robot.history(since=since, until=since + most - 1).rows
        if not len(rows):
            return
        self.missed += max(0, int(rows["iteration"][0]) - self._next) if every else 0
        self.topics.publish(rows)
        self.published += len(rows)
        self._next = int(rows["iteration"][-1]) + 1

    def _attach(self) -> bool:
        """Attaches to a new backend, if there is one; returns whether it did."""
        known, settings = self._frontend, self._shared.settings
        try:
            found = o80.Frontend(self.segment, 0.0, read_only=True)
        except Error as error:
            self._problem = str(error)
            return False
        if found.published < 0 or (known is not None and known.epoch == found.epoch):
            found.close()
            return False
        self.close()
        self._frontend, self._next = found, found.published
        if self.topics is not None and self.topics.schema != found.schema:
            self.topics.destroy()
            self.topics = None
        self.topics = self.topics or Topics(self._shared, found)
        if not found.played and (settings.command or (settings.step and found.bursting)):
            try:
                arm = o80.Frontend(self.segment, 0.0)
                self._commands = Commands(self._shared, arm, self.refuse)
            except Error as error:
                self.refuse("commands", error)
        return True

    def status(self) -> tuple[bytes, str, dict[str, object]]:
        """Returns level, message and values for /diagnostics."""
        values: dict[str, object] = {"refused": self.refused, "last refusal": self._why}
        values |= {"published": self.published, "missed": self.missed, "left out": self.late}
        robot = self._frontend
        if robot is None:
            return STALE, self._problem, values
        values |= {"robot": robot.robot, "iteration": robot.published}
        values |= {"overruns": robot.overruns, "missed ticks": robot.missed_ticks}
        values["rate reached"] = robot.rate_reached
        if not robot.alive:
            return ERROR, f"its backend has ended: {robot.life}", values
        if (halt := robot.halted) is not None:
            values |= {"halt": halt.number, "halt cause": halt.cause, "halt text": halt.text}
            return WARN, f"halted (halt {halt.number}): {halt.text}", values
        if self._shared.node.count_publishers(f"/{self.name}/desired") > 1:
            return WARN, "another gateway publishes this name: give one of them --prefix", values
        if trouble := robot.trouble:
            return WARN, trouble, values
        return OK, "bursting" if robot.bursting else f"running at {robot.frequency:g} Hz", values

    def close(self, *, topics: bool = False) -> None:
        """Detaches. topics: also removes the topics."""
        if self._commands is not None:
            self._commands.close()
            self._commands = None
        if self._frontend is not None:
            self._frontend.close()
        if topics and self.topics is not None:
            self.topics.destroy()
