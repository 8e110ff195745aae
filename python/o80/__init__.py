"""Real-time control, simulators and learning code in step, through shared memory."""

from o80._core import version

__version__ = version()

__all__ = ["__version__", "version"]
