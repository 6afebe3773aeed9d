"""Golden outputs: numbers that Oarlock computed at one commit, to compare another commit with. Run by `make golden`."""
