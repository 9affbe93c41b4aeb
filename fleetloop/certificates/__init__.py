"""Certificates of a fleet: an authority, and what it signs; `fleetloop certs`."""
