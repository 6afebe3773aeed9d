"""Which inertial unit sits where, from movements in a known order."""
