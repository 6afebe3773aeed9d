"""How a rower, oars and a boat are drawn in the player."""
