"""Flight, rebound and impact of a ball, for fits and predictions."""
