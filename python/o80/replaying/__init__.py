"""Exact replay: recorded robots are started again, and every row is compared."""
