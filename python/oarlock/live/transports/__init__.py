"""What carries bytes: each transport delivers packets as they arrive, and says how it does."""
