"""`fleetloop campaign`: fault by time by seed, a verdict each."""
