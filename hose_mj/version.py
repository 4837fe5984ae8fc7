"""The version, for what records it; a file of its own, since `hose_mj` itself stands on top."""

__version__ = "0.2.0"
