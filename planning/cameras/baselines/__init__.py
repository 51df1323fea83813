"""Eqs. (9)-(10): seams, the coverage triangle, the largest baselines."""
