"""What each projector shows: ring patterns, frames, files."""
