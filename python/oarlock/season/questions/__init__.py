"""Questions to a season: ready ones with uncertainty, or SQL; by DuckDB over the compacted tables."""
