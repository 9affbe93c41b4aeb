"""ODrive CANSimple, firmware 0.6 layout: frames, client (host) and node (drive)."""
