"""Drive protocols: each a folder with frames, client (controller's end) and node (the drive's end)."""
