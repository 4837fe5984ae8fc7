"""The files that `hose-mj compare` writes: tables, pictures and the HTML page."""
