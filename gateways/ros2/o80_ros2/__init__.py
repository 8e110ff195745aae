"""Gateway to ROS 2: one process publishes the rows of robots and accepts commands for them."""
