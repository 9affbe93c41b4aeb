"""Jobs of `compare` and `campaign`, each in a process of its own."""
