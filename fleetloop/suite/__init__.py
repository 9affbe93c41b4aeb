"""`fleetloop test`: scenarios as tests, one after the other or side by side."""
