"""`fleetloop compare`: laws side by side on one scenario and the same seeds."""
