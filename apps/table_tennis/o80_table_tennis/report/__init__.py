"""What is kept and shown of episodes: records, statistics, plots, films, the report."""
