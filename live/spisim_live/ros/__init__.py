"""Results for ROS 2: messages, and MCAP files of them."""
