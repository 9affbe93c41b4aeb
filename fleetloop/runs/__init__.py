"""Runs that go on in the background on this machine: which there are, and their end."""
