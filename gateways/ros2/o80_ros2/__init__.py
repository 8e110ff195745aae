"""Gateway to ROS 2: one process that publishes the rows of robots and takes commands for them."""

from o80.base.installation import check_version

check_version("o80-ros2")
