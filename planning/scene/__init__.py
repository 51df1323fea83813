"""What is lit, seen and measured of a surface, by rays and the limits."""
