"""Scenes by name: those that ship with hose_mj, and those of other packages by entry points.

A package names its scenes in the group `hose_mj.scenes`; the entry's name is the scene's, and what
it names is the path of an MJCF file, or of a folder with NAME.xml in it, or a function that returns
one of these, or a module that lies in such a folder:

    [project.entry-points."hose_mj.scenes"]
    yard = "my_package.scenes"
"""

import os
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

from hose_mj.assets import find_assets
from hose_mj.errors import InputError
from hose_mj.plugins import find_plugins, load_plugin

GROUP = "hose_mj.scenes"


def list_scenes() -> tuple[str, ...]:
    """Returns the names of the shipped scenes, then those of other packages.

    Raises:
        InputError: another package takes a name that is a shipped scene's, or a third package's.
    """
    own = _list_shipped()
    return (*own, *find_plugins(GROUP, own))


def find_scene(name: str | Path) -> Path:
    """Returns the path of a scene by its name ("floor_4"), or of a file that is there.

    Raises:
        InputError: neither; or another package's scene that cannot be had.
    """
    named = find_named(name)
    if named is not None:
        return named
    if Path(name).is_file():
        return Path(name)
    raise _refuse(name)


def find_named(name: str | Path) -> Path | None:
    """Returns the path of a scene by its name; None for a path.

    Raises:
        InputError: a name that no scene has, or another package's scene that cannot be had.
    """
    if not isinstance(name, (str, os.PathLike)):
        raise InputError("scene", name, "the name of a scene, or an MJCF file")
    path = Path(name)
    if path.suffix == ".xml" or len(path.parts) != 1:
        return None
    own = _list_shipped()
    if str(name) in own:
        return find_assets() / "scenes" / f"{name}.xml"
    if path.exists():
        return None
    entry = find_plugins(GROUP, own).get(str(name))
    if entry is None:
        raise _refuse(name)
    return _find_plugin_file(entry)


def _refuse(name: str | Path) -> InputError:
    return InputError("scene", str(name), f"an MJCF file, or one of {', '.join(list_scenes())}")


def _list_shipped() -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in (find_assets() / "scenes").glob("*.xml")))


def _find_plugin_file(entry: EntryPoint) -> Path:
    """Returns the MJCF file that an entry point leads to."""
    named = load_plugin(entry)
    if isinstance(named, ModuleType):
        named = Path(named.__file__ or "").parent
    elif callable(named):
        named = named()
    thing = f"scene {entry.name} ({entry.value})"
    if not isinstance(named, (str, os.PathLike)):
        valid = "the path of an MJCF file or of its folder, or a function that returns it"
        raise InputError(thing, repr(named), valid)
    path = Path(named)
    file = path / f"{entry.name}.xml" if path.is_dir() else path
    if not file.is_file():
        raise InputError(thing, str(file), "an MJCF file that is there")
    return file
