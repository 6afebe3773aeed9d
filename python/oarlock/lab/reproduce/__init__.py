"""Every table and figure of the source paper, run again beside the printed values."""
