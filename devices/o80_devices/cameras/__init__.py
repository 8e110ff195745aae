"""Cameras as robots, and what they see.

| module | what it holds |
|---|---|
| rig.py | where the cameras are, and what they see of the world |
| synthetic_cameras.py, video_cameras.py, genicam_cameras.py | drivers of cameras |
| image_source.py | their images, for a reader |
| scene.py, throws.py, ball_of_segment.py | what synthetic cameras see |
| aravis.py, newest_image.py, pixel_formats.py | what GenICam cameras need |
"""
