"""The controller of one robot: the part that moves onto the robot."""

import configs.compiled  # noqa: F401 - first: it finds the modules below
