"""Foxglove and Lichtblick: a layout for a run, and the run itself over their WebSocket."""
