"""Gray-code captures of a camera and a projector that no plan is of."""
