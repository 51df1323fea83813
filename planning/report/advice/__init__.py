"""Which limit, relaxed by how little, would make a plan meet its requirements."""
