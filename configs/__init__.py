"""Scenario and deployment files: types, validation, and the briefs that processes receive."""

import configs.compiled  # noqa: F401 - first: it finds the modules below
