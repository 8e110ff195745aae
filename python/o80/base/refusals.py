"""System calls that a sandbox refuses: profiles of containers, gVisor."""

import contextlib
import errno
from collections.abc import Iterator

from o80.base.errors import Error


@contextlib.contextmanager
def explained(what: str) -> Iterator[None]:
    """Turns a refused system call into an Error with its source line. what: a verb."""
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.ENOSYS):
            raise
        import traceback  # here, for it takes long to import

        frame = traceback.extract_tb(error.__traceback__)[-1]
        raise Error(
            f"cannot {what}: the system refuses a call that this needs ({error}; "
            f"{frame.filename}:{frame.lineno}: {frame.line}). If this is a container or sandbox, "
            f"allow the call in its profile"
        ) from error
