"""The page of a season: one HTML file that says who rowed how much, what changed, and how far to trust it."""
