"""How good a track is: scores against truth, optical markers, other estimators, studies, suspected faults."""
