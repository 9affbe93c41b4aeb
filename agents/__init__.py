"""The controller of one robot: the part that moves onto the robot."""
