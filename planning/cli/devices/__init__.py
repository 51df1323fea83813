"""Commands about devices: which there are, which suit, and what they show."""
