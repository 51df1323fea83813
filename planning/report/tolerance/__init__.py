"""What becomes of a plan's claims in rigs that aren't built exactly as planned."""
