"""Puts the rows of recordings back into shared memory, as if their robots ran again."""
