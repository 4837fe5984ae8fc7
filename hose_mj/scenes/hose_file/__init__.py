"""A user's hose, described in a TOML file."""
