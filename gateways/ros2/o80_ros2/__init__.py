"""Gateway to ROS 2: one process publishes the rows of robots and accepts commands for them."""

from o80.base.installation import check_version

check_version("o80-ros2")
