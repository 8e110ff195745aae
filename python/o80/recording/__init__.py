"""Rows of segments in MCAP files: writing them while robots run, and reading them again."""
