"""Records, statistics and pictures of episodes, and the report of the demo."""
