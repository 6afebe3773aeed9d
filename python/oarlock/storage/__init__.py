"""Files and arrays for all other packages: array checks, TOML, Parquet, delimited text, paths, exceptions."""
