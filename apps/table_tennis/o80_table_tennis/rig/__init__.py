"""The arm and the simulated twins that mirror it, with their balls, with three pacings."""
