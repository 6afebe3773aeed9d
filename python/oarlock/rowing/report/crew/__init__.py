"""The page of a crew: `write_crew_report` and its sections."""
