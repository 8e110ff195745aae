"""First line that the child process of a watched client prints."""

STARTED = b"started"
"""Printed when the client begins to connect. Each later line is a frame in JSON."""
