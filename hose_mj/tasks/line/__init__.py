"""The line task: robots that pull a hose of line segments over a grid."""
