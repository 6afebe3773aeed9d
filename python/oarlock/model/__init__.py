"""Models of bodies: model files and their loading, coordinates, rotations, shapes of the figure."""
