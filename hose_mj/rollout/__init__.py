"""Episodes in a world: driven, watched, recorded."""
