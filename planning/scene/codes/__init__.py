"""What projectors show, and the surfaces of equal code that it makes of their light."""
