"""Table tennis with a pneumatic arm: real robot, simulated ball."""
