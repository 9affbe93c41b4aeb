"""The plant's buses: one file a kind."""
