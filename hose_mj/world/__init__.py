"""A scene, its robots and a hose of any model, with one clock."""
