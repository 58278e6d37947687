"""`robot-bridge` on the robot: takes its state, events and recordings to the fleet's hub."""
