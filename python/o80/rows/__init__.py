"""Rows of a robot as NumPy arrays, their description, and the entries of its journal."""
