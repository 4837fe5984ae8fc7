"""Worlds by the name of the hose's model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hose_mj.errors import InputError
from hose_mj.hoses.registry import check_model
from hose_mj.scenes.mjcf.scene import Scene, find_scene, read_scene
from hose_mj.world.cable_world import CableWorld
from hose_mj.world.flex_world import FlexWorld
from hose_mj.world.geds_world import GedsWorld
from hose_mj.world.world import World

WORLDS: dict[str, type[World]] = {"geds": GedsWorld, "cable": CableWorld, "flex": FlexWorld}


def make_world(scene: Scene | str | Path, model: str = "geds", **options: Any) -> World:
    """Makes a world, at the start of its scene.

    Args:
        scene: checked, or the name of a shipped one, or an MJCF file.
        model: of the hose, one of `WORLDS`.
        **options: those of the world's class, such as `timestep`.

    Raises:
        InputError: an unknown scene, model or option, or what reading the scene finds wrong.
    """
    if model not in WORLDS:
        raise InputError("model", model, "one of " + ", ".join(WORLDS))
    check_model(model)
    if not isinstance(scene, Scene):
        scene = read_scene(find_scene(scene))
    return WORLDS[model](scene, **options)
