"""The body: model files and their loading, coordinates, rotations, shapes of its figure."""
