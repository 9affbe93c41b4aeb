"""Emulated CAN buses: hub, packets, transports and the python-can interface `fleetloop`."""
