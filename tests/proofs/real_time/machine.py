"""A virtual machine in software: boots a kernel and an initial file system, and ends by itself."""

import os
import selectors
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Console:
    """Output of the machine, and whether it ended by itself."""

    text: str
    powered_off: bool

    def without_findings(self) -> str:
        """Text for people: failed tests, and what the kernel printed."""
        return "\n".join(
            line
            for line in self.text.splitlines()
            if not line.startswith("rt: ") or line.startswith("rt: wrong")
        )


def boot(
    kernel: Path, image: Path, words: dict[str, str], timeout: float, log: Path, more: str = ""
) -> Console:
    """Runs the machine until it powers off; it is ended after so many seconds.

    more: words of the kernel's command line.
    """
    # the kernel's own threads go before the tests, and a slow host is no stall
    own = ["rcutree.kthread_prio=50", "rcupdate.rcu_cpu_stall_suppress=1"]
    line = " ".join(
        [
            "console=ttyS0",
            "panic=-1",
            "quiet",
            *own,
            *more.split(),
            *(f"o80.{key}={words[key]}" for key in words),
        ]
    )
    machine = subprocess.Popen(
        ["setpriv", "--pdeathsig", "KILL", "qemu-system-x86_64",
         "-accel", "tcg,thread=multi", "-smp", "2", "-m", "1024", "-nic", "none",
         "-nodefaults", "-nographic", "-serial", "stdio", "-no-reboot",
         "-kernel", kernel, "-initrd", image, "-append", line],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    assert machine.stdout is not None
    deadline = time.monotonic() + timeout
    said = bytearray()
    ended = False
    with machine, log.open("wb", buffering=0) as kept, selectors.DefaultSelector() as selector:
        selector.register(machine.stdout, selectors.EVENT_READ)
        while not ended and (left := deadline - time.monotonic()) > 0:
            if selector.select(left):
                some = os.read(machine.stdout.fileno(), 1 << 16)
                said += some
                kept.write(some)
                ended = not some
        if not ended:
            machine.kill()
    text = said.decode(errors="replace").replace("\r", "")
    return Console(text, powered_off=ended and machine.returncode == 0)
