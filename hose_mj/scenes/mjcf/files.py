"""The files of an MJCF scene: what they name, and nothing outside the scene's folder.

MuJoCo opens whatever a scene names. Before it does, every XML file is read here with limits: well
formed UTF-8 without document type or entities, bounded in size, elements and depth, and each
attribute that names a file or a folder leads to a file below the scene's own folder.
"""

import hashlib
import math
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from hose_mj.errors import InputError

LARGEST_XML = 1_000_000  # bytes of one XML file
LARGEST_ASSET = 20_000_000  # bytes of one mesh, texture or other asset
LARGEST_SCENE = 64_000_000  # bytes of all files together
MOST_FILES = 200
MOST_FOLDERS = 8  # folders of assets
MOST_NAMED = 1000  # elements that name a file
MOST_ELEMENTS = 20_000  # in all XML files together
DEEPEST = 64  # elements within each other
_FOLDERS = ("assetdir", "meshdir", "texturedir")
_XML = ("include", "model")
_SHOWN = 80


@dataclass
class SceneFiles:
    """What a scene consists of; filled by `read_files`."""

    path: Path  # the scene's file, without symbolic links
    # SHA-256 of each file read, by its path.
    contents: dict[Path, str] = field(default_factory=dict)
    n_bytes: int = 0  # sizes added up
    n_elements: int = 0  # XML elements met
    # Folders in which assets are looked for, relative to the scene's.
    folders: list[str] = field(default_factory=lambda: [""])
    # What elements name: (where, XML or asset, value, file that names it).
    wanted: list[tuple[str, bool, str, Path]] = field(default_factory=list)

    @property
    def digest(self) -> str:
        """SHA-256 over all files and where they lie below the scene's folder."""
        folder = self.path.parent
        lines = [f"{p.relative_to(folder).as_posix()} {h}" for p, h in self.contents.items()]
        return hashlib.sha256("\n".join(sorted(lines)).encode("utf-8", "replace")).hexdigest()


def read_files(path: Path) -> SceneFiles:
    """Reads and checks all files of a scene, without MuJoCo.

    Raises:
        InputError: a file that is missing, too large, not plain XML or outside the folder.
    """
    try:
        files = SceneFiles(Path(path).resolve(strict=True))
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError("file", shorten(str(path)), f"a file to be read ({error})") from error
    _read_xml(files, files.path, "file")
    known = 0
    while known != len(files.contents):  # each file may name more files, and folders to look into
        known = len(files.contents)
        for where, is_xml, name, namer in list(files.wanted):
            for file in _find(files, where, name, namer) if is_xml else ():
                if file not in files.contents:
                    _read_xml(files, file, where)
    for where, _, name, namer in files.wanted:
        for file in _find(files, where, name, namer):
            if file not in files.contents:
                _read(files, file, where, LARGEST_ASSET)
    return files


def shorten(text: str) -> str:
    """A text as one printable line of bounded length."""
    line = "".join(c if c.isprintable() else " " for c in " ".join(text.split()))
    return line if len(line) <= _SHOWN else f"{line[:_SHOWN]}..."


def _find(files: SceneFiles, where: str, name: str, namer: Path) -> list[Path]:
    """Every file that MuJoCo could mean by a name; raises `InputError` where there is none."""
    folder = files.path.parent
    found = []
    for base in dict.fromkeys((folder, namer.parent)):
        # With <compiler strippath="true"/> a file's folder does not count.
        for inner, tail in product(files.folders, dict.fromkeys((name, Path(name).name))):
            try:
                file = (base / inner / tail).resolve()
                is_there = file.exists()
            except (OSError, ValueError, RuntimeError) as error:
                raise InputError(where, shorten(name), "a file in the scene's folder") from error
            if is_there and not file.is_relative_to(folder):
                raise InputError(where, shorten(name), "a file in the scene's folder, not a link")
            if is_there and file.is_file() and file not in found:
                found.append(file)
    if not found:
        raise InputError(where, shorten(name), "a file in the scene's folder (there is none)")
    return found


def _read(files: SceneFiles, file: Path, where: str, most: int) -> bytes:
    name = shorten(file.name)
    if not file.is_file():
        raise InputError(where, name, "a file to be read")
    try:
        with open(file, "rb") as stream:
            data = stream.read(most + 1)
    except OSError as error:
        raise InputError(where, name, f"a file to be read ({error.strerror})") from error
    if len(data) > most:
        raise InputError(where, name, f"a file of at most {most} bytes")
    files.n_bytes += len(data)
    files.contents[file] = hashlib.sha256(data).hexdigest()
    if files.n_bytes > LARGEST_SCENE:
        raise InputError(where, name, f"files of at most {LARGEST_SCENE} bytes together")
    if len(files.contents) > MOST_FILES:
        raise InputError(where, name, f"at most {MOST_FILES} files in a scene")
    return data


def _read_xml(files: SceneFiles, file: Path, where: str) -> None:
    data = _read(files, file, where, LARGEST_XML)
    _Reader(files, file).read(data)


def _name_attribute(tag: str, name: str, key: str) -> str:
    element = f"{tag} {name}" if name else tag
    return f"<{shorten(element)}> {shorten(key)}"


class _Reader:
    """Walks through one XML file without building a tree."""

    def __init__(self, files: SceneFiles, file: Path) -> None:
        self._files, self._file, self._depth = files, file, 0
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = self._refuse_doctype

    def read(self, data: bytes) -> None:
        try:
            data.decode("utf-8")
            self._parser.Parse(data, True)
        except (expat.ExpatError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            valid = f"MJCF, which is well-formed XML in UTF-8 ({shorten(str(error))})"
            raise InputError("file", shorten(self._file.name), valid) from error

    def _fail(self, element: str, value: str, valid: str) -> NoReturn:
        place = f"line {self._parser.CurrentLineNumber}"
        raise InputError(f"{shorten(self._file.name)}: {element} ({place})", shorten(value), valid)

    def _refuse_doctype(self, name: str, *_: object) -> None:
        self._fail("<!DOCTYPE>", name, "XML without document type and entities")

    def _end(self, _: str) -> None:
        self._depth -= 1

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._files.n_elements += 1
        if self._depth == 1 and tag != "mujoco":
            self._fail("first element", tag, "mujoco (MJCF)")
        if self._depth > DEEPEST:
            self._fail("depth of elements", str(self._depth), f"at most {DEEPEST}")
        if self._files.n_elements > MOST_ELEMENTS:
            valid = f"at most {MOST_ELEMENTS} in a scene"
            self._fail("number of elements", str(self._files.n_elements), valid)
        name = attributes.get("name", "")
        for key, value in attributes.items():
            self._check_finite(tag, name, key, value)
            is_folder = tag == "compiler" and key in _FOLDERS
            if not (is_folder or key.startswith("file")):
                continue
            where = _name_attribute(tag, name, key)
            self._check_inside(where, value)
            if is_folder:
                self._files.folders = list(dict.fromkeys((*self._files.folders, value)))
            elif value:
                place = f"{shorten(self._file.name)}: {where}"
                self._files.wanted.append((place, tag in _XML, value, self._file))
            if len(self._files.folders) > MOST_FOLDERS:
                self._fail(where, value, f"at most {MOST_FOLDERS} folders of assets")
            if len(self._files.wanted) > MOST_NAMED:
                self._fail(where, value, f"at most {MOST_NAMED} elements that name files")

    def _check_finite(self, tag: str, name: str, key: str, value: str) -> None:
        """Refuses NaN, which MuJoCo takes for "not given", and infinities."""
        try:
            is_finite = key == "name" or all(math.isfinite(float(x)) for x in value.split())
        except ValueError:
            return  # no list of numbers
        if not is_finite:
            self._fail(_name_attribute(tag, name, key), value, "finite numbers")

    def _check_inside(self, where: str, value: str) -> None:
        parts = value.replace("\\", "/").split("/")
        leaves = ".." in parts or (parts[0] == "" and len(parts) > 1) or ":" in value
        if leaves or "\\" in value or not value.isprintable():
            self._fail(where, value, "a path below the scene's folder, without '..'")
