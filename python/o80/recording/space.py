"""Disk space kept back, so that a file can be finished on a full disk."""

import ctypes
import errno
import os
from functools import lru_cache
from typing import Any

KEEP_SIZE = 1  # FALLOC_FL_KEEP_SIZE: blocks beyond the end of the file, whose length stays


def reserve(descriptor: int, offset: int, length: int) -> None:
    """Reserves blocks of a file. Raises OSError if there are not so many.

    A file system that cannot do this is left as it is.
    """
    if _fallocate()(descriptor, KEEP_SIZE, offset, length) == 0:
        return
    number = ctypes.get_errno()
    if number not in (errno.EOPNOTSUPP, errno.ENOSYS):
        raise OSError(number, os.strerror(number))


@lru_cache(maxsize=1)
def _fallocate() -> Any:
    function = ctypes.CDLL(None, use_errno=True).fallocate
    function.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
    return function
