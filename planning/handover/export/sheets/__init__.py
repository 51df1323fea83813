"""What a builder holds in hand: a drawing with dimensions, and aiming sheets."""
