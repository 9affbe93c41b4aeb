"""The emulated hardware: bodies, motors, encoders, localisation."""

import configs.compiled  # noqa: F401 - first: it finds the modules below
