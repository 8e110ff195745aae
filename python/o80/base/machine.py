"""The properties of a machine that decide the last bits of a computation."""

import json
import os
import platform
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Self

from o80.base.finite import json_text


@dataclass(frozen=True)
class Machine:
    """C library and processor of a machine; mathematical functions differ between them."""

    libc: str  #: "glibc 2.36"
    architecture: str  #: "x86_64"
    features: tuple[str, ...]  #: features of the processor, sorted

    def as_json(self) -> str:
        """Converts to one line of JSON, which `from_json` reads."""
        return json_text(asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Parses `as_json`. Raises ValueError, KeyError, TypeError if the text is damaged."""
        found = json.loads(text)
        return cls(
            str(found["libc"]), str(found["architecture"]), tuple(map(str, found["features"]))
        )

    def difference(self, other: "Machine") -> str:
        """Describes the difference to another machine; empty if there is none."""
        if self.libc != other.libc:
            return f"{self.libc} recorded it, this machine has {other.libc}"
        if self.architecture != other.architecture:
            return f"a machine of {self.architecture} recorded it, this one is {other.architecture}"
        differ = sorted(set(self.features) ^ set(other.features))
        if differ:
            more = f" and {len(differ) - 3} more" if len(differ) > 3 else ""
            return f"the processors differ in their features: {', '.join(differ[:3])}{more}"
        return ""


@lru_cache
def this_machine() -> Machine:
    """Returns the machine of this process."""
    try:
        libc = os.confstr("CS_GNU_LIBC_VERSION") or ""
    except (ValueError, OSError):
        libc = ""
    return Machine(libc or " ".join(platform.libc_ver()), platform.machine(), _features())


@lru_cache
def this_boot() -> str:
    """Returns the id of this boot, within which monotonic times agree; empty: not known."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


def _features() -> tuple[str, ...]:
    """Reads the features of the first processor, as listed by Linux."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return ()
    for line in text.splitlines():
        name, _, value = line.partition(":")
        if name.strip() in ("flags", "Features"):
            return tuple(sorted(value.split()))
    return ()
