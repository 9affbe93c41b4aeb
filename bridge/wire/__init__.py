"""Emulated classic CAN wire in bus time: bits, arbitration, queues, errors, faults. Pure."""
