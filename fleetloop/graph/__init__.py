"""`fleetloop graph`: the directed graph of a scenario, as a table, a file or a picture."""
