"""What of a user's hose a model cannot run, and why."""

from __future__ import annotations

from typing import Any

from hose_mj.errors import InputError
from hose_mj.hoses.registry import find_model, make_hose
from hose_mj.scenes.hose_file.hose_file import OwnHose
from hose_mj.validation.user_hose.case import make_obstacles, starts_at_rest

FEWEST_SEGMENTS = 10
"""The coarsest chain that is run."""
_SOME_SPIN = 1e-3


def find_obstacle(own: OwnHose, model: str) -> InputError | None:
    """Why a model cannot run this hose, or None."""
    options: dict[str, Any] = {} if model == "geds" else {"segments": FEWEST_SEGMENTS}
    if own.floor is not None:
        why = _find_floor_obstacle(own, model)
        if why is not None:
            return InputError("floor", own.floor.height, f"left out: {why}")
        options["obstacles"] = make_obstacles(own)
    try:
        hose = make_hose(model, own.spec, gravity=own.gravity, timestep=1e-3, **options)
    except InputError as error:
        return InputError(f"hose.{error.thing}", error.value, f"for {model} {error.valid}")
    if own.spins:
        try:
            hose.move(hose.clamp(0.0), spin=_SOME_SPIN)
        except InputError as error:
            return InputError("spin", "given", f"left out: {model} takes {error.valid}")
    return None


def _find_floor_obstacle(own: OwnHose, model: str) -> str | None:
    """Why a model cannot lie on a floor here, or None."""
    if not find_model(model).contact:
        return f"{model} touches nothing"
    if model != "geds" and starts_at_rest(own):
        return f"only geds finds a rest shape on it; {model} runs with study.start = 'as-laid'"
    return None
