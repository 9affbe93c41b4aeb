"""What this machine, its installation and its user's rights allow a run, and what to change."""
