"""Policies, from a still arm to one that returns most balls."""
