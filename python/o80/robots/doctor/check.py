"""A check, its findings, and the evidence that it evaluates."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from o80.robots.doctor.computer import SYS_NICE, Computer, Sample

PRIORITY = 81  # of `o80 run` without --priority, and one more for the helper thread
BUSY = 0.25  # least share of a processor for a thread to be reported
MATTERS = 0.1  # least share of a period for a delay to be reported
SHORTEST = 0.2  # [s] between samples: the kernel counts in ticks of 10 ms


@dataclass(frozen=True)
class Finding:
    """A cause of delays of a loop on this computer."""

    name: str
    seen: str  #: the measured figure
    effect: str
    cure: str  #: a command, or a sentence if there is none
    undo: str  #: a command; empty: nothing was changed
    delay: float  #: delay of an iteration when it happens [s]
    remark: bool  #: it happens only under conditions in `effect`, so it does not count


@dataclass(frozen=True)
class Evidence:
    """State of a computer before and after a measurement, for all checks."""

    computer: Computer
    frequency: float
    before: Sample
    after: Sample
    refused: tuple[str, ...] = ()  #: lines of a robot about real-time settings
    free_memory: int | None = None  #: in /dev/shm [bytes]

    @property
    def seconds(self) -> float:
        """Time between the samples [s]; 0 if it is too short to compute rates."""
        passed = self.after.uptime - self.before.uptime
        return passed if passed >= SHORTEST else 0.0

    def busy(self) -> list[tuple[float, int, int, str]]:
        """Busy threads: share of a processor, thread, processor, name; the busiest first."""
        found = []
        for number, now in self.after.threads.items():
            then = self.before.threads.get(number)
            if then is None or not self.seconds:
                continue
            share = (now.ticks - then.ticks) / 100 / self.seconds
            # the thread of an interrupt runs where the interrupt occurs
            if share >= BUSY and not now.name.startswith("irq/"):
                found.append((share, number, now.processor, now.name))
        return sorted(found, reverse=True)

    def interrupts(self) -> Iterator[tuple[float, int, str, str]]:
        """Yields interrupts of devices: rate [1/s], processor, number, device."""
        columns = self.computer.processors
        for number, now in self.after.interrupts.items():
            then = self.before.interrupts.get(number)
            if then is None or not self.seconds:
                continue
            for i, count in enumerate(now.counts[: len(columns)]):
                came = count - then.counts[i] if i < len(then.counts) else 0
                if came > 0:
                    yield came / self.seconds, columns[i], number, now.device

    @property
    def realtime_kit(self) -> str:
        """Answer of RealtimeKit to the measured robot; empty: no request."""
        found = re.search(r"RealtimeKit granted .*?(?=\. Allow|$)", "\n".join(self.refused), re.M)
        return found[0] if found else ""

    @property
    def granted(self) -> bool:
        """Whether limits allow the priority of `o80 run`."""
        limit = self.computer.limit("Max realtime priority")
        may = self.computer.may(SYS_NICE) or limit is None or limit >= PRIORITY
        return may and not any("real-time priority" in line for line in self.refused)

    @property
    def real_time(self) -> bool:
        """Whether `o80 run` gets a real-time priority here."""
        return self.granted or re.match(r"RealtimeKit granted \d", self.realtime_kit) is not None


class Check:
    """Checks for one possible cause of delays."""

    name: ClassVar[str]
    delay: ClassVar[float]  #: delay that it may add to an iteration [s]
    effect: ClassVar[str]
    cure: ClassVar[str] = ""
    undo: ClassVar[str] = ""
    of_host: ClassVar[bool] = True  #: in a container, the host has to be changed

    def look(self, at: Evidence) -> Iterator[Finding]:
        """Yields findings on a computer, for any rate of the loop."""
        raise NotImplementedError

    def found(
        self,
        at: Evidence,
        seen: str,
        *,
        delay: float | None = None,
        remark: bool = False,
        effect: str | None = None,
        cure: str | None = None,
        undo: str | None = None,
        **values: object,
    ) -> Finding:
        """Makes a finding; texts that are not given are this check's, filled with `values`."""
        cure = self.cure.format(**values) if cure is None else cure
        undo = self.undo.format(**values) if undo is None else undo
        if self.of_host and at.computer.container:
            cure, undo = on_host(cure), on_host(undo)
        return Finding(
            self.name,
            seen,
            self.effect.format(**values) if effect is None else effect,
            cure,
            undo,
            self.delay if delay is None else delay,
            remark,
        )


def in_container(kind: str, flags: str) -> str:
    """Returns how to start a container with docker flags: a command, or a sentence."""
    if kind in ("docker", "podman"):
        return f"{kind} run {flags} ..."
    return f"start the container ({kind}) with what `docker run {flags}` would give it"


def on_host(commands: str) -> str:
    """Adds to commands the remark that they are for the host of a container."""
    first, newline, rest = commands.partition("\n")
    remark = ", on the container's host" if "  # " in first else "  # on the container's host"
    return commands and first + remark + newline + rest
