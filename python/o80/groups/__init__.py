"""Copies of a robot that step together, and bursts of several backends in one call."""
