"""Files that are either whole or absent: written beside their place, synced, then moved there."""

import os
import secrets
from pathlib import Path


def write_atomically(path: Path, data: bytes) -> None:
    """Writes bytes so that a reader, or a crash at any moment, sees the old file or the new one."""
    path = Path(path)
    temp = make_temp_beside(path)
    try:
        temp.write_bytes(data)
        replace_atomically(temp, path)
    finally:
        temp.unlink(missing_ok=True)


def replace_atomically(temp: Path, final: Path) -> None:
    """Syncs a finished file `temp` to disk and moves it over `final` (same folder)."""
    with open(temp, "rb+") as stream:
        os.fsync(stream.fileno())
    os.replace(temp, final)
    sync_folder(final.parent)


def make_temp_beside(path: Path) -> Path:
    """Creates an empty file in the folder of `path` (which is made if absent) and returns it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temp = path.with_name(f".{path.name}.{secrets.token_hex(6)}.part")
    temp.open("xb").close()
    return temp


def sync_folder(folder: Path) -> None:
    """Makes a rename in a folder last through a power cut, where the system can."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    except OSError:
        pass
    finally:
        os.close(handle)
