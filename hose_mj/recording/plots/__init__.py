"""Plots as PNG bytes: one function per kind, no pyplot, no global state.

Labels that start with a model id take that model's colour and marker (`hose_mj.recording.palette`).
"""

from hose_mj.extras import require

require("matplotlib", "drawing plots")
