"""Gateway to ROS 2: one process that publishes the rows of robots and takes commands for them."""
