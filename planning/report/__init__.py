"""From a partial plan to a plan: claims recomputed, entries, summary and advice."""
