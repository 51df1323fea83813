"""Fewest sets that cover several times, and go on covering when any one is lost."""
