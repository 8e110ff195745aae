"""Sources of balls: recordings, their reconstruction, simulated shots, sampled flights."""
