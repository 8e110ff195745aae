"""Trains a policy for any task: `python -m o80.learning --help`."""

from o80.learning.training.commands import main

if __name__ == "__main__":
    main()
