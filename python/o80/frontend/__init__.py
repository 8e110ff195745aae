"""o80.Frontend, the side that commands and reads: a file for each group of methods.

| file | methods |
|---|---|
| describing.py | description of the robot: names, actuators, requests, period, life |
| watching.py | rate_reached, overruns, missed_ticks, row_age, slow_verb, trouble |
| observing.py | latest, wait_for, wait_for_next, stream, history, ... |
| commanding.py | add_command, add_trajectory, add_request, purge, pulse, pulse_and_wait, ... |
| previewing.py | preview |
| moving.py | move_to |
| bursting.py | burst, prepared_burst |
| controlling.py | exclusive control |
| halting.py | halt, halted, resume, keep_alive |
| frontend.py | opening, closing, attaching again |

Methods under `if TYPE_CHECKING` are compiled, because programs call them thousands of times a
second. The build takes their signatures and docstrings from there (python/bindings/verbs.py).
"""
