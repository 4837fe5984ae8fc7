"""Keeps what was simulated: episodes in memory, Parquet and CSV, Rerun recordings, plots, HTML."""
