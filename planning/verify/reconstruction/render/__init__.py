"""What cameras see of the patterns: images with blur, noise and ambient light."""
