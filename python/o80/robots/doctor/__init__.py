"""Checks whether this computer can serve a robot at a given rate, and finds causes of delays."""
