"""Policies, from a still arm to a learned player."""
