"""Where the files that ship with hose_mj lie: materials, example hoses, scenes."""

from pathlib import Path

from hose_mj.errors import InputError

_PACKAGE = Path(__file__).resolve().parent


def find_assets(package: Path = _PACKAGE) -> Path:
    """Returns the folder of the assets: inside the package in a wheel, beside it in a checkout.

    Raises:
        InputError: an installation without assets.
    """
    for folder in (package / "assets", package.parent / "assets"):
        if folder.is_dir():
            return folder
    valid = f"a folder {package / 'assets'}; install hose_mj again"
    raise InputError("folder of the assets", None, valid)


def find_asset(name: str) -> Path:
    """Returns the path of one asset, such as "materials.toml" or "hoses/usb_cable.toml".

    Raises:
        InputError: there is no such file among the assets.
    """
    folder = find_assets()
    path = (folder / name).resolve()
    if not (path.is_relative_to(folder.resolve()) and path.is_file()):
        listed = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
        raise InputError("asset", name, ", ".join(listed))
    return path
