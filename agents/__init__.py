"""One robot's controller: what moves onto the robot."""
