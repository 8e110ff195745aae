"""The comparison of `o80 diff`, by the name under which users import it."""

from o80.joining.difference import Difference as Difference
from o80.joining.difference import RobotsDifferError as RobotsDifferError
from o80.joining.difference import first_difference as first_difference
