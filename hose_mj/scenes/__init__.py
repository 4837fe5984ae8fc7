"""What a user describes in files: materials and hoses in TOML, scenes in MJCF."""
