"""A season made from a seed: raw data of noise and strokes with known truth, to try and to measure everything else."""
