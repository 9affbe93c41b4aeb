"""What a run came to: summary, tables, figures, page, export, comparison."""
