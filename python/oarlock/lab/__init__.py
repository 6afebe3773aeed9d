"""Tools for the project itself: benchmarks against other software, and the reproduction of the source paper."""
