"""The wires: CAN buses, drive protocols, Zenoh links, messages, clocks."""

import configs.compiled  # noqa: F401 - first: it finds the modules below
