"""`fleetloop live`: a run as a page that moves, and its controls."""
