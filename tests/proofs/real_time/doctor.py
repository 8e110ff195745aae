"""Boots the machine with faults for `o80 doctor` to find, one at a time, and judges its reports.

The machine has no Python: it prints what the doctor reads, and the doctor reads that here.
"""

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from real_time.image import make_image
from real_time.machine import boot
from real_time.recorded_computers import RecordedComputer

FREQUENCY = 1000.0
MACHINE = "virtual machine"  # the emulation itself, which is always there
RECORDED = re.compile(r"^rt: begin (.*)\n((?:.*\n)*?)rt: end \1$", re.MULTILINE)
# name of what was recorded => findings beside the emulation
EXPECTED: dict[str, list[str]] = {
    **{f"clean {turn}": [] for turn in [*range(1, 11), "again"]},
    "throttling": ["throttling of real-time threads"],
    "priority limit 0": ["priority limit"],
    "locked memory 64 kB": ["locked memory limit"],
    "limits cured": [],
    "busy on the isolated processor": ["busy neighbours"],
    "swap": ["swap"],
    "small shared memory": ["size of /dev/shm"],
    "tiny shared memory": ["size of /dev/shm"],
    "autogroup": ["autogroup"],
    "wrong clock source": ["clock source"],
    "interrupt storm": ["interrupts"],
    "not isolated": [],  # which costs too little where nothing else runs
    "not isolated, a busy neighbour": ["missing isolation"],
}


def sections(lines: str) -> str:
    """Lines "path:line", and after "later" those of two seconds later, as a recorded computer."""
    now, _, later = lines.partition("later\n")
    text = ""
    for mark, part in (("---", now), ("+++", later)):
        files: dict[str, str] = {}
        for line in part.splitlines():
            path, _, content = line.partition(":")
            files[path] = files.get(path, "") + content + "\n"
        text += "".join(f"{mark} {path.lstrip('/')}\n{files[path]}" for path in files)
    return text


def faults_of_the_doctor(kernel: Path, folder: Path, timeout: float) -> Iterator[str]:
    """Boots twice, with and without an isolated processor; what the doctor said wrongly."""
    image = folder / "doctor.cpio"
    make_image(image, [], "doctor.sh")
    recorded: dict[str, str] = {}
    # the kernel does not trust the clock of an emulated processor by itself
    always = "tsc=reliable irqaffinity=0 noirqdebug"
    for name, more in (
        ("doctor", f"{always} isolcpus=1 nohz_full=1 rcu_nocbs=1"),
        ("doctor-shared", always),
    ):
        words = {"isolated": "no"} if name == "doctor-shared" else {}
        console = boot(kernel, image, words, timeout, folder / f"{name}.log", more)
        recorded.update(RECORDED.findall(console.text))
        if not console.powered_off:
            yield f"the machine of {name} did not end by itself"
    for name, expected in EXPECTED.items():
        with tempfile.TemporaryDirectory() as root:
            text = sections(recorded.get(name, ""))
            report = RecordedComputer(Path(root), text).examine(FREQUENCY)
        found = [finding.name for finding in report.findings]
        print(f"doctor: {name}: {', '.join(f'{f.name} ({f.seen})' for f in report.findings)}")
        if sorted(found) != sorted([MACHINE, *expected]) or report.unread:
            yield f"the doctor found {found} after '{name}', and could not read {report.unread}"
