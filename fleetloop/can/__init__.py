"""The operator's CAN tools: `fleetloop can list | dump | send | gateway | slcan`."""
