"""Monte-Carlo studies: what happens to the error when sensors, noise, mounts, rates or settings change."""
