"""Rows of segments in MCAP files: writing them while robots run, and reading them again."""

from o80.base.extras import needed

for module in ("mcap", "zstandard"):
    needed(module, "record", "a recording")
