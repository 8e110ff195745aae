"""Boots a machine in software whose first process is systemd, and runs a robot there as a service.

The unit is examples/systemd/o80@.service, the robot the arm of examples/udp_arm with its fake. The
service is started, killed, crashed, halted, stopped and started with wrong flags. Ends with 1, and
shows what was printed, if anything is not as docs/real_time/service.md says.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from checkout import ROOT
from real_time.kernel import NoKernelError, obtain_kernel
from real_time.machine import boot
from service_machine.image import NoSystemdError, make_image

# what the machine says => what it must say; a text ends with "..." where the rest may vary
EXPECTED = {
    "verify": "",
    "started": "active: runs on segment 'udp_arm'",
    "user": "robot",
    "state": "runs",
    "moves": "active",
    "after-kill": "halted 1 predecessor...",
    "after-kill-moves": "rejected",
    "after-resume": "runs",
    "after-resume-moves": "active",
    "after-crash": "halted 1 predecessor...",
    "status-of-halt": "halted in iteration ...",
    "after-kill-halted": "halted 1 predecessor...",
    "before-stop": "active",
    "stopped": "inactive success 0",
    "after-stop": "runs",
    "before-fault": "active",
    "after-fault": "runs",
    "gone": "failed exit-code after ...",
    "wrong-flags": "failed 2 restarts 0",
}


def fits(said: str, expected: str) -> bool:
    return said.startswith(expected[:-3]) if expected.endswith("...") else said == expected


def faults(said: dict[str, str]) -> Iterator[str]:
    """Differences from what is expected."""
    for key, expected in EXPECTED.items():
        if not fits(said.get(key, "nothing"), expected):
            yield f"{key}: '{said.get(key, 'nothing')}' instead of '{expected}'"
    if "SCHED_FIFO" not in said.get("policy", "") or "80" not in said.get("policy", ""):
        yield f"policy: {said.get('policy')}"
    if int(said.get("locked") or 0) == 0:
        yield "no memory was locked"
    if "core.o80-run" not in said.get("dump", ""):
        yield f"dump: {said.get('dump')}"
    how, _, braked = said.get("watched", "").partition(", ")
    if how != "stopped" or int(braked.split()[0] if braked else 0) == 0:
        yield f"the robot did not brake before it stopped: {said.get('watched')}"
    for key in ("journal-fault", "journal-halt", "journal-start"):
        if int(said.get(key) or 0) == 0:
            yield f"{key}: the journal does not say it"
    if "over" not in said:
        yield "the machine did not come to its end"
    if "wrong" in said:
        yield said["wrong"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kernel", type=Path, help="a kernel; default: Debian's PREEMPT_RT one")
    parser.add_argument("--build", type=Path, default=ROOT / "build/dev", help="of preset dev")
    parser.add_argument("--timeout", type=float, default=900, help="of the machine [s]")
    arguments = parser.parse_args()

    machine = ROOT / "build/rt/machine"
    image = machine / "service.cpio"
    try:
        kernel = arguments.kernel or obtain_kernel(machine)
        make_image(image, arguments.build)
    except (NoKernelError, NoSystemdError) as error:
        print(error, file=sys.stderr)
        return 1
    begin = time.monotonic()
    console = boot(kernel, image, {}, arguments.timeout, machine / "service.log")
    mark = "service: "
    lines = [line.removeprefix(mark) for line in console.text.splitlines() if line.startswith(mark)]
    said = {key: rest.strip() for key, _, rest in (line.partition(" ") for line in lines)}
    wrong = list(faults(said))
    print(*(lines if not wrong else [console.text]), sep="\n")
    for each in wrong:
        print(f"WRONG: {each}")
    seconds = time.monotonic() - begin
    print(f"{'failed' if wrong else 'all held'} as a service of systemd, in {seconds:.0f} s")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
