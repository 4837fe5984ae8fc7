"""Scenes with robots and a hose, described in MJCF."""

from typing import Any

__all__ = ["Place", "Robot", "Scene", "find_scene", "list_scenes", "read_scene"]


def __getattr__(name: str) -> Any:
    """Loads what is asked for; names of scenes need neither MuJoCo nor the hose's tables."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in ("find_scene", "list_scenes"):
        from hose_mj.scenes.mjcf import catalogue

        return getattr(catalogue, name)
    from hose_mj.scenes.mjcf import scene

    return getattr(scene, name)
