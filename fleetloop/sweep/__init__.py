"""Sweeps: many runs that differ in some factors, and what comes of them."""
