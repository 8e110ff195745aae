"""Does it help to let one motion of the arm meet many balls? SAC with and without virtual balls.

The method is that of Guist, Schneider, Dittrich, Berenz, Schölkopf and Büchler, "Hindsight States:
Blending Sim and Real Task Elements for Efficient Reinforcement Learning" (RSS 2023).
`python -m o80_table_tennis.learning.virtual` runs the comparison; needs the extra `learn`.
"""
