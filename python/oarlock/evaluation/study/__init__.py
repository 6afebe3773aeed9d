"""Monte-Carlo studies: how errors change with sensors, noise, mounts, sample rates and settings."""
