"""The whole decision about motion: one table of phases and one pure step, without ROS, sockets or clocks."""
