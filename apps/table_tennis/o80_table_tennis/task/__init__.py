"""What is played: actions, observations, rewards, ends of episodes, and the tasks themselves."""
