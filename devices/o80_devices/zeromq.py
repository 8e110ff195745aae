"""Imports the package pyzmq when a device needs it."""

from __future__ import annotations

from typing import Any

from o80.errors import DriverError


def required() -> Any:
    """Returns the module `zmq`. Raises DriverError if it is not installed."""
    try:
        import zmq
    except ImportError as error:
        raise DriverError(
            f"this device speaks ZeroMQ, and pyzmq cannot be imported ({error}): "
            "pip install 'o80-devices[zeromq]'"
        ) from None
    return zmq
