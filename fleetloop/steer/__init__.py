"""`fleetloop steer`."""
