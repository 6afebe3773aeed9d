"""The verbs that oarlock-lab adds to `oarlock lab`, one file each; see entry-points in pyproject.toml."""
