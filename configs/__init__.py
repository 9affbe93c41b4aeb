"""Scenario and deployment files: types, validation, and the briefs that processes receive."""
