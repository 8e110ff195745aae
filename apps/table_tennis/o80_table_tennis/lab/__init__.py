"""The laboratory: arm, world, launcher, cameras, tracker, motion capture, environment, together."""
