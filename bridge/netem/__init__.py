"""Emulated network, per directed edge: delay, loss, order, bandwidth, cuts. Pure."""
