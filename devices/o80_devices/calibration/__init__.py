"""Calibrates a rig of cameras: lenses from a chessboard, places from a waved ball.

| module | what it holds |
|---|---|
| calibrate.py | the command |
| board.py, lenses.py | intrinsics from a chessboard |
| waved_ball.py, table_corners.py | input of the extrinsics |
| extrinsics.py, bundle.py, world_frame.py | extrinsics |
"""
