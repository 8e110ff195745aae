"""Lines that the process of a watched client prints."""

STARTED = b"started"
"""The first line: from now on the client connects. Each line after it is a frame in JSON."""
