"""Optional parts of the installation, by job: `pip install 'hose-mj[viewer]'`.

Whoever needs one says so before any work is done, with `require`.
"""

import importlib.util
from collections.abc import Sequence

from hose_mj.errors import HoseError

EXTRAS = {
    "cable": ("dm_control",),
    "viewer": ("rerun",),
    "report": ("matplotlib", "pyarrow"),
    "rl": ("gymnasium", "pettingzoo", "dm_env", "PIL"),
    "classifiers": ("sklearn", "threadpoolctl"),
    "video": ("imageio_ffmpeg",),
    "deep": ("stable_baselines3", "sb3_contrib", "torch"),
    "cluster": ("dask", "distributed"),
}
"""The modules of each extra, by the names that are imported."""


class MissingExtra(HoseError, ImportError):  # noqa: N818 - it names what is wrong
    """An optional part of the installation that is not there.

    Args:
        extra: which; several with commas between (``"report,viewer"``).
        purpose: what it is wanted for, as the subject of a sentence (``"rendering films"``).
    """

    def __init__(self, extra: str, purpose: str) -> None:
        self.extra, self.purpose = extra, purpose
        kind = "extras" if "," in extra else "extra"
        names = " and ".join(f"`{name}`" for name in extra.split(","))
        super().__init__(f"{purpose} needs the {kind} {names}: pip install 'hose-mj[{extra}]'")


def find_extra(module: str) -> str | None:
    """Returns the extra that brings a module (``"rerun.chunk"``); None where none does."""
    top = module.partition(".")[0]
    return next((extra for extra, modules in EXTRAS.items() if top in modules), None)


def is_installed(extra: str) -> bool:
    """Says whether every module of an extra can be found; imports none of them."""
    return not find_missing(extra)


def find_missing(extra: str) -> list[str]:
    """Returns the modules of an extra that cannot be found."""
    return [module for module in EXTRAS[extra] if not _is_found(module)]


def require(part: str, purpose: str) -> None:
    """Checks, without importing it, that an extra or a module of one is there.

    Args:
        part: an extra (``"viewer"``), or a module that one of them brings (``"rerun"``).
        purpose: what it is wanted for, as the subject of a sentence (``"the viewer"``).

    Raises:
        MissingExtra: it is not there; the message says what to install.
    """
    extra = part if part in EXTRAS else find_extra(part)
    if extra is None:
        raise ValueError(f"{part!r} is neither an extra nor a module of one")
    missing = find_missing(extra) if part in EXTRAS else [part] * (not _is_found(part))
    if missing:
        raise MissingExtra(extra, purpose)


def require_all(extras: Sequence[str], purpose: str) -> None:
    """Checks several extras as `require` does one; what is missing is said at once.

    Raises:
        MissingExtra: one or more are not there.
    """
    if missing := [extra for extra in extras if not is_installed(extra)]:
        raise MissingExtra(",".join(missing), purpose)


def _is_found(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):  # ValueError: a module set to None, or half imported
        return False
