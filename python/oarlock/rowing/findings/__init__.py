"""What stands out in a piece: sizes, uncertainties, usual values and what to try, with sources, for reports."""
