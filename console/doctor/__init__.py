"""What is wrong between this computer and the robot, from the name of the robot up to the picture."""
