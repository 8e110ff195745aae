"""A real or simulated robot and a simulated world as one experiment: the task is written once.

class Push(o80.hybrid.HybridTask): ...

o80.hybrid.make(Push)                                  # one robot, inline
o80.hybrid.make_vec(Push, 64)                          # copies to learn on
o80.hybrid.make(Push, pacing="real_time", robot=...)   # the robot itself

Needs the extras `gym` and `record`. See docs/hybrid.md.
"""

from o80.base.extras import needed

needed("gymnasium", "gym", "o80.hybrid")

from o80.hybrid.mirror import Mirror, difference  # noqa: E402
from o80.hybrid.recorded import Transitions, relive  # noqa: E402
from o80.hybrid.rig import Rig, attach  # noqa: E402
from o80.hybrid.task import HybridTask, make, make_vec  # noqa: E402
from o80.learning.task import EVERY, Index, Outcome  # noqa: E402

__all__ = [
    "EVERY",
    "HybridTask",
    "Index",
    "Mirror",
    "Outcome",
    "Rig",
    "Transitions",
    "attach",
    "difference",
    "make",
    "make_vec",
    "relive",
]
