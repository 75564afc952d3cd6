"""Path."""
