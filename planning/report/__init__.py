"""From a draft to a plan: claims recomputed, entries written, summary and advice."""
