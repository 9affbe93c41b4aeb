"""`fleetloop fault`."""
