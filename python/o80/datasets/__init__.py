"""Data sets for learning, made from the episodes that a program marked in its recording."""
