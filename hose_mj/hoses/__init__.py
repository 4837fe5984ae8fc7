"""Hose models: one spec, one protocol, GEDS and MuJoCo's chains behind it."""
