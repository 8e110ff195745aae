"""Objects that are closed by a `with` block, or when the interpreter ends."""

from types import TracebackType
from typing import Self


class Closeable:
    """Has `close`; give the object to `shutdown.close_later` too."""

    def close(self) -> None:
        raise NotImplementedError

    def _close_at_exit(self) -> None:
        self.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
