"""A run in one process: the reference of runs over processes."""
