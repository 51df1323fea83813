"""The triangle mesh, its topology, and samples of it."""
