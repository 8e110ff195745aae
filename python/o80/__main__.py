"""``python -m o80`` is the command ``o80``."""

from o80.cli import main

main()
