"""o80.Frontend, which commands and reads a robot, as three classes with their helpers.

| file | methods of o80.Frontend |
|---|---|
| reader.py | the robot and its backend, the loop, rows: latest, wait_for, stream, history, ... |
| commander.py | add_command, pulse, request, preview, move_to, burst, control, halt, resume, ... |
| frontend.py | opening, closing, attaching again |

Methods under `if TYPE_CHECKING` are compiled, because programs call them thousands of times a
second. The build takes their signatures and docstrings from there (python/bindings/verbs.py).
"""
