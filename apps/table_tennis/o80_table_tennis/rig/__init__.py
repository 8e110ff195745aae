"""The arm and the simulated twins that mirror it, with their balls, in three ways of pacing."""
