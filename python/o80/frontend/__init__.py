"""The side that commands and reads: every verb of o80.Frontend, typed, a file for each concern.

| file | verbs |
|---|---|
| describing.py | what the segment says of its robot: names, actuators, requests, period, life |
| observing.py | latest, wait_for, wait_for_next, stream, history, ... |
| commanding.py | add_command, add_trajectory, add_request, purge, pulse, pulse_and_wait, ... |
| bursting.py | burst, prepared_burst |
| controlling.py | exclusive control |
| halting.py | halt, halted, resume, keep_alive |
| frontend.py | opening, closing, attaching again |

What stands under `if TYPE_CHECKING` is compiled, because it is called thousands of times a second:
the build takes signature and docstring of the compiled verb from there (python/bindings/verbs.py).
"""

from o80.frontend.frontend import Frontend

__all__ = ["Frontend"]
