"""Write docs/reference/*.md: `uv run python -m docs.generate`."""

from docs.generate.pages import FOLDER, pages

for name, text in pages().items():
    (FOLDER / name).write_text(text, "utf-8")
