"""Errors, words, checks of arguments, processes and texts, which every room uses."""
