"""One image a camera, rings told apart by a prior mesh."""
