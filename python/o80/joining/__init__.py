"""Rows of several segments or recordings, joined by time."""
