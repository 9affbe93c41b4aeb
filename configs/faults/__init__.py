"""Section [[fault]]."""
