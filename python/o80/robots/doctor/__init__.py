"""Doctor of a computer: whether it can serve a robot at a given rate, and what is in the way."""
