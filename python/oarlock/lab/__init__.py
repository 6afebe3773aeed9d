"""What serves the project rather than its users: benchmarks beside other software, and the source paper run again."""
