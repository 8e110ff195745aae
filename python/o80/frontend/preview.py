"""Preview of a command."""

from dataclasses import dataclass, field

from o80.rows.states import States


@dataclass(frozen=True, eq=False)
class Preview:
    """Preview of a command: the answer of Frontend.preview."""

    iterations: int  #: number of iterations that it takes
    late: int  #: by how many of them it takes longer than asked, at most 65535
    text: str  #: why, as `Handle.text` says it; empty if it is not late
    #: the desired states of all actuators, as in History.desired: (iterations, actuators), or a
    #: record of groups
    rows: States = field(repr=False)
