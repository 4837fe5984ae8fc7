"""`hose-mj list`: what there is by name, that of plug-ins included."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import tyro

from hose_mj.errors import check_choice
from hose_mj.extras import require
from hose_mj.recording.document import make_document, print_document


@dataclass(frozen=True)
class Args:
    """List what can be named on the command line, with a line about each."""

    kind: Annotated[str, tyro.conf.Positional]
    """scenes, hoses, materials, models, policies, tasks, learners or environments."""
    json: bool = False  # Print one JSON document on stdout.


def run(args: Args) -> int:
    """Prints a list; 0 when done."""
    check_choice("kind", args.kind, KINDS)
    found = KINDS[args.kind]()
    if args.json:
        items = [{"name": name, "description": text} for name, text in found.items()]
        print_document(make_document("list", args, results={"items": items}))
        return 0
    width = max(map(len, found), default=0)
    for name, text in found.items():
        print(f"{name:{width}}  {text}".rstrip())
    return 0


def _describe(module: str, attribute: str) -> dict[str, str]:
    """Names and descriptions of what a module lists."""
    found = getattr(importlib.import_module(module), attribute)()
    return {name: entry.description for name, entry in found.items()}


def list_scenes() -> dict[str, str]:
    """Shipped scenes; the line is the comment that the file begins with."""
    import re

    from hose_mj.plugins import load_plugins
    from hose_mj.scenes.mjcf.catalogue import find_scene, list_scenes

    def read_title(name: str) -> str:
        comment = re.search(r"<!--(.*?)-->", find_scene(name).read_text("utf-8"), re.S)
        text = " ".join(comment.group(1).split()) if comment else ""
        return re.split(r"(?<=[.:;])\s", text)[0].rstrip(".:;")

    return load_plugins({name: name for name in list_scenes()}, read_title)


def list_hoses() -> dict[str, str]:
    """Ready hoses, and the files of hoses that `hose-mj compare` takes by name."""
    import tomllib

    from hose_mj.assets import find_assets
    from hose_mj.hoses.materials import read_catalogue

    found = {name: entry.title for name, entry in read_catalogue().hoses.items()}
    for file in sorted((find_assets() / "hoses").glob("*.toml")):
        title = tomllib.loads(file.read_text("utf-8")).get("title", "")
        found[file.stem] = f"{title} (a file for hose-mj compare)"
    return found


def list_materials() -> dict[str, str]:
    """Materials that a hose can be made of."""
    from hose_mj.hoses.materials import read_catalogue

    return {name: entry.title for name, entry in read_catalogue().materials.items()}


def list_policies() -> dict[str, str]:
    """Policies of `hose-mj rollout`."""
    from hose_mj.rollout.policies import POLICIES

    about = {"random": "targets at random", "to-goal": "drives the tip to the goal"}
    return {
        name: about.get(name, f"drives until the constraint breaks: {name.removeprefix('break-')}")
        for name in POLICIES
    } | {"RUN": "the folder of a run: a learner that hose-mj train line has saved"}


def list_learners() -> dict[str, str]:
    """Learners, with their place in the thesis."""
    from hose_learning.learners import catalog

    return {
        name: f"{one.description} ({one.section})" for name, one in catalog.list_learners().items()
    }


def list_environments() -> dict[str, str]:
    """Ids of Gymnasium and PettingZoo."""
    require("rl", "hose-mj list environments")
    from hose_mj.envs import name_environment

    return {name_environment(task): text for task, text in KINDS["tasks"]().items()}


KINDS: dict[str, Callable[[], dict[str, str]]] = {
    "scenes": list_scenes,
    "hoses": list_hoses,
    "materials": list_materials,
    "models": partial(_describe, "hose_mj.hoses.registry", "list_models"),
    "policies": list_policies,
    "tasks": partial(_describe, "hose_mj.tasks.registry", "list_tasks"),
    "learners": list_learners,
    "environments": list_environments,
}
