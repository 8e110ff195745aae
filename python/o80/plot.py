"""The plot of `o80 plot`, by the name under which users import it."""

from o80.joining.plot import Curve as Curve
from o80.joining.plot import plot as plot
