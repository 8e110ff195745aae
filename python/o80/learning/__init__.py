"""Gymnasium environments over copies of a robot in this process: a task is written once.

class Reach(o80.learning.GroupTask): ...

environment = o80.learning.Environment(Reach(copies=1))
environments = o80.learning.VectorEnvironment(Reach(copies=16))

Needs the extra `gym`. See docs/learning.md.
"""

from o80.extras import needed

needed("gymnasium", "gym", "o80.learning")

from o80.learning.environment import Environment  # noqa: E402
from o80.learning.group_task import GroupTask  # noqa: E402
from o80.learning.registration import register  # noqa: E402
from o80.learning.task import EVERY, Index, Outcome, Task  # noqa: E402
from o80.learning.vector_environment import VectorEnvironment  # noqa: E402

__all__ = [
    "EVERY",
    "Environment",
    "GroupTask",
    "Index",
    "Outcome",
    "Task",
    "VectorEnvironment",
    "register",
]
