"""Worlds by the name of the hose's model."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hose_mj.errors import check_choice
from hose_mj.hoses.registry import check_model, check_options

if TYPE_CHECKING:
    from hose_mj.scenes.mjcf.scene import Scene
    from hose_mj.world.world import World

WORLDS = {
    "geds": "hose_mj.world.geds_world:GedsWorld",
    "cable": "hose_mj.world.cable_world:CableWorld",
    "flex": "hose_mj.world.flex_world:FlexWorld",
}
"""Worlds' classes by the hose's model, loaded when one is asked for."""


def make_world(scene: Scene | str | Path, model: str = "geds", **options: Any) -> World:
    """Makes a world, at the start of its scene.

    Args:
        scene: checked, or a name of `list_scenes`, or an MJCF file.
        model: of the hose, one of `WORLDS`.
        **options: those of the world's class, such as `timestep`.

    Raises:
        InputError: an unknown scene, model or option, or what reading the scene finds wrong.
    """
    from hose_mj.scenes.mjcf.scene import Scene, find_scene, read_scene

    check_choice("model", model, WORLDS)
    check_model(model)
    module, _, name = WORLDS[model].partition(":")
    world_class: type[World] = getattr(import_module(module), name)
    check_options(model, world_class, options)
    if not isinstance(scene, Scene):
        scene = read_scene(find_scene(scene))
    return world_class(scene, **options)
