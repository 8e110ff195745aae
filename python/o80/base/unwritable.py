"""Reasons why a file cannot be written."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from o80.base.errors import Error


def reason(path: Path, error: OSError) -> str:
    """Returns the reason, for example "there is no folder results"."""
    if isinstance(error, FileNotFoundError) and not path.parent.exists():
        return f"there is no folder {path.parent}"
    if path.is_dir():
        return "it is a folder"
    return os.strerror(error.errno) if error.errno else str(error)


@contextmanager
def writing(path: Path, kind: type[Error] = Error) -> Iterator[None]:
    """Turns an OSError of its block into an Error of this kind that names the file."""
    try:
        yield
    except Error:
        raise
    except OSError as error:
        raise kind(f"{path} cannot be written: {reason(path, error)}") from error
