"""Files and arrays below every noun: the array gate, TOML, Parquet, delimited text, paths, and the package's errors."""
