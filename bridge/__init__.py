"""The wires: CAN buses, drive protocols, Zenoh links, messages, clocks."""
