"""What reality replaces: bodies, motors, encoders, localisation."""
