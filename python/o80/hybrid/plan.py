"""Length of a step of a rig, and form of its actions."""

from dataclasses import dataclass
from pathlib import Path

from o80.base.errors import InvalidArgument
from o80.base.words import RowsWord
from o80.hybrid.rig import Rig


@dataclass(frozen=True)
class Plan:
    """Length of a step of a rig, and form of its actions. InvalidArgument if they do not fit."""

    rig: Rig
    folder: Path
    """Folder to which relative paths of the rig refer."""
    chunk_size: int | None = None
    """Rows of an action, each for `every` iterations; None: an action is one target."""
    action_steps: int = 1
    """Rows of a chunk in a step; the others act only while the next chunk is late."""
    profile: RowsWord = "smooth"
    """Profile of the motion between the rows of a chunk."""

    def __post_init__(self) -> None:
        if self.action_steps > (self.chunk_size or 1):
            raise InvalidArgument(
                f"action_steps must be at most chunk_size, got {self.action_steps} of "
                f"{self.chunk_size or 'no chunk'}"
            )
        if self.rig.delay >= self.iterations:
            raise InvalidArgument(
                f"delay must be less than the {self.iterations} iterations of a step, got "
                f"{self.rig.delay}: give a smaller delay, more iterations a step, or chunks"
            )

    @property
    def iterations(self) -> int:
        """Iterations of the robot in one step."""
        return self.rig.every * self.action_steps
