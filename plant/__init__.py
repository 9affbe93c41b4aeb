"""The emulated hardware: bodies, motors, encoders, localisation."""
