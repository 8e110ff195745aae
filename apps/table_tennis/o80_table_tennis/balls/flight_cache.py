"""Caches fitted flights in files, so that a second process need not fit them again.

A fit takes up to 0.4 s. Its result is stored in the user's cache folder (`$XDG_CACHE_HOME`, else
`~/.cache`), under `o80/flights`. The name is a hash of the recorded rows, the period and this
package's sources: another version of the fit never finds the results of an earlier one. A file is
written beside its final place and renamed, which is safe with several processes. A damaged file
is ignored, and so is a folder that cannot be written.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from .sampled_flight import SampledFlight

PACKAGE = Path(__file__).parent.parent
SOURCES = ("balls", "physics", "world")
"""Subpackages that affect a fit."""
ARRAYS = ("positions", "velocities", "bounce_times", "residuals", "spins")
DAMAGED = (OSError, ValueError, KeyError, EOFError, BadZipFile)


def folder() -> Path:
    """Returns the folder of the flights, which may be removed at any time."""
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    home = Path(cache_home) if os.path.isabs(cache_home) else Path.home() / ".cache"
    return home / "o80" / "flights"


def cached_flight(
    content: bytes, name: str, period: float, fit: Callable[[], SampledFlight]
) -> SampledFlight:
    """Returns the flight of `content`, from the cache, or fitted and stored there."""
    key = hashlib.sha256(f"{_version()} {period!r} ".encode() + content).hexdigest()
    try:
        file = folder() / f"{key[:40]}.npz"
        return _read(file, name, period)
    except RuntimeError:  # a user without a home
        return fit()
    except DAMAGED:
        flight = fit()
    with suppress(OSError):
        _write(file, flight)
    return flight


@cache
def _version() -> str:
    """Hashes all sources that affect a fit."""
    hashed = hashlib.sha256()
    for part in SOURCES:
        for source in sorted((PACKAGE / part).rglob("*")):
            if source.suffix in (".py", ".xml"):
                hashed.update(source.name.encode() + source.read_bytes())
    return hashed.hexdigest()


def _read(file: Path, name: str, period: float) -> SampledFlight:
    """Reads a flight. Raises one of `DAMAGED`; the file has a checksum of each array."""
    with np.load(file, allow_pickle=False) as content:
        return SampledFlight(name, period, **{each: content[each] for each in ARRAYS})


def _write(file: Path, flight: SampledFlight) -> None:
    """Writes a flight atomically."""
    file.parent.mkdir(parents=True, exist_ok=True)
    arrays = {each: getattr(flight, each) for each in ARRAYS}
    handle, beside = tempfile.mkstemp(dir=file.parent, prefix=".", suffix=".npz")
    try:
        with os.fdopen(handle, "wb") as stream:
            np.savez(stream, **arrays)
        os.replace(beside, file)
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise
