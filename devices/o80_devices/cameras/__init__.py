"""Cameras as robots, and the scenes of synthetic ones.

| module | what it holds |
|---|---|
| rig.py | places and lenses of the cameras, the ball and the table |
| synthetic_cameras.py, video_cameras.py, genicam_cameras.py | drivers of cameras |
| image_source.py | reads the images of their segments |
| scene.py, throws.py, ball_of_segment.py | scene of the synthetic cameras |
| aravis.py, newest_image.py, pixel_formats.py | parts of the GenICam driver |
"""
