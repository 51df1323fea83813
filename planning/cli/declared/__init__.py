"""The commands as click sees them; what they do is imported when one runs."""
