"""Where balls come from: recordings, their reconstruction, simulated shots, sampled flights."""
