"""Errors of recordings."""

from o80.errors import Error


class RecordingError(Error):
    """A recording cannot be written or read; the text names the file and what to do."""
