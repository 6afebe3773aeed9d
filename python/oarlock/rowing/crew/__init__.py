"""Several seats of one boat: clocks, matched strokes, and timing of catch and finish between seats."""
