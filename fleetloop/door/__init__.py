"""The door of a run: requests to its launcher from other programs of this user."""
