"""Scenes with robots and a hose, described in MJCF."""
