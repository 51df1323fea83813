"""Claims about baselines and ranges."""
