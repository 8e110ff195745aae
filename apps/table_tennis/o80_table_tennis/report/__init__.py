"""Records, statistics, plots and films of episodes, and the report of the demo."""
