"""Learning to return balls: training, evaluation, baselines, curves.

Needs the extra `learn`; it is imported late, so that playing a policy needs NumPy only.
"""
