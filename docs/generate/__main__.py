"""Write docs/reference/*.md: `uv run python -m docs.generate`."""

import os

os.environ["FLEETLOOP_PURE"] = "1"  # first: a compiled class has no docstring of its own
from docs.generate.pages import FOLDER, pages

for name, text in pages().items():
    (FOLDER / name).write_text(text, "utf-8")
