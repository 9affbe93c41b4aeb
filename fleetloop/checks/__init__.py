"""What can be said of a scenario before it runs: pure checks, one subject a module."""
