"""Which segments a user may trust like own files."""

import os
import pwd
from typing import TYPE_CHECKING

from o80.frontend.segments import segments

if TYPE_CHECKING:
    from o80.frontend.frontend import Frontend


def is_own(frontend: "Frontend") -> bool:
    """True for a segment of a robot that this user runs, or ran.

    False for a recording that is played, which may come from a stranger, and for a robot of another
    user.
    """
    if frontend.played:
        return False
    try:
        user = pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        user = str(os.geteuid())
    return any(each.name == frontend.segment and each.user == user for each in segments())
