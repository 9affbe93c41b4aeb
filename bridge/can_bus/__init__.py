"""The emulated CAN bus: packets, hub and the python-can interface `fleetloop`."""
