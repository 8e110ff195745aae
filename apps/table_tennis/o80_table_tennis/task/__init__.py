"""Tasks: actions, observations, rewards, ends of episodes, and the named tasks."""
