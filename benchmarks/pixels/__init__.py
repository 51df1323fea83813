"""What rendered pixels say of plans."""
