"""The command line: ``o80 run | list | info | echo | stop | clean``."""

from __future__ import annotations

from o80.cli.app import main

__all__ = ["main"]
