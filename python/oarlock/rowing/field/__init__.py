"""The field simulator: sculling on the water with errors that the model does not contain."""
