"""The results of a run: summary, tables, figures, page, export, comparison."""
