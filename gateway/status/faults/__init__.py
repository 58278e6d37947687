"""What is wrong with the robot, since when, and what to do: rules that find it, a book of its life."""
