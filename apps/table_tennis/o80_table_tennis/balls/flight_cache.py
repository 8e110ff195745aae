"""Fitted flights kept in files, so that a second process need not fit them again.

A fit takes up to 0.4 s. Its result is kept in the user's cache folder (`$XDG_CACHE_HOME`, else
`~/.cache`), under `o80/flights`, by a hash of the recorded rows, of the period, and of the sources
of this package, so that another version of the fit never finds the results of an earlier one. A
file is written beside its place and renamed, which is safe with several processes. A damaged file,
or a folder that cannot be written, is as good as none.
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
"""The parts of this package that a fit depends on."""
ARRAYS = ("positions", "velocities", "bounce_times", "residuals", "spins")
DAMAGED = (OSError, ValueError, KeyError, EOFError, BadZipFile)


def folder() -> Path:
    """Where the flights are kept; it may be removed at any time."""
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    home = Path(cache_home) if os.path.isabs(cache_home) else Path.home() / ".cache"
    return home / "o80" / "flights"


def cached_flight(
    content: bytes, name: str, period: float, fit: Callable[[], SampledFlight]
) -> SampledFlight:
    """The flight of `content`, read from the cache, or fitted and put there."""
    key = hashlib.sha256(f"{_version()} {period!r} ".encode() + content).hexdigest()
    try:
        file = folder() / f"{key[:40]}.npz"
        return _read(file, name, period)
    except RuntimeError:  # nobody's home
        return fit()
    except DAMAGED:
        flight = fit()
    with suppress(OSError):
        _write(file, flight)
    return flight


@cache
def _version() -> str:
    """Hash of all that decides a fit."""
    hashed = hashlib.sha256()
    for part in SOURCES:
        for source in sorted((PACKAGE / part).rglob("*")):
            if source.suffix in (".py", ".xml"):
                hashed.update(source.name.encode() + source.read_bytes())
    return hashed.hexdigest()


def _read(file: Path, name: str, period: float) -> SampledFlight:
    """Raises one of `DAMAGED`: the file has a checksum of each array."""
    with np.load(file, allow_pickle=False) as content:
        return SampledFlight(name, period, **{each: content[each] for each in ARRAYS})


def _write(file: Path, flight: SampledFlight) -> None:
    """In one piece or not at all."""
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
