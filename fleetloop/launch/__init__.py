"""Runs from start to end: roles as processes, or all in one."""
