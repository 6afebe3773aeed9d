"""Benchmarks of the project: puts the figures of `cargo bench` and of the installed package into one table."""
