"""A process of a run: its life from brief to exit status, its clocks, waits and profile."""
