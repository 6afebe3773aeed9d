"""`season run`: computes the results that a season lacks, in processes of this machine or on a Dask cluster."""
