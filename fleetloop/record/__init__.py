"""The record of a run: `record.mcap`, every signal of every robot at every tick."""
