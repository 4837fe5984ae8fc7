"""`hose-mj warm`: compiles every kernel once, so that nothing has to wait for it later."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import tyro

from hose_mj.cli.progress import show_progress
from hose_mj.errors import InputError, check_choice
from hose_mj.recording.document import make_document, print_document

SCHEMES = ("bdf2", "backward-euler", "sdirk2", "midpoint")
"""Verlet wants a step of its own, see `_use_verlet`."""
NAMED_LEARNERS = {"line": "thresholded-msav"}
"""The learner that warms a task, where that is not d-rr-ql; all learners warm corridor or taxi."""

Job = Callable[[], Any]


@dataclass(frozen=True)
class Args:
    """Compile the kernels that this machine does not have yet; what is compiled stays on the disk.

    A command that was stopped goes on where it was, since each kernel is kept as soon as it is
    compiled. Where they are kept: hose-mj doctor, "kernel cache".
    """

    groups: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="GROUP")] = ()
    """hose, world, learn; all of them by default."""
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.


def run(args: Args) -> int:
    """Runs a little of everything; 0 when done."""
    for group in args.groups:
        check_choice("group", group, GROUPS)
    jobs = {f"{g}: {n}": job for g in args.groups or GROUPS for n, job in GROUPS[g]().items()}
    from hose_mj.jit import count_compiled

    records: list[dict[str, Any]] = []
    with show_progress("kernels", len(jobs)) as advance:
        for name, job in jobs.items():
            begun, before = time.perf_counter(), count_compiled()
            job()
            seconds, compiled = time.perf_counter() - begun, count_compiled() - before
            records.append({"name": name, "compiled": compiled, "wall_s": seconds})
            advance(1)
    total = sum(record["compiled"] for record in records)
    wall_s = sum(record["wall_s"] for record in records)
    if args.json:
        results = {"records": records, "compiled": total, "wall_s": wall_s}
        print_document(make_document("warm", args, results=results))
    else:
        for record in records:
            if record["compiled"]:
                print(f"{record['name']}: {record['compiled']} compiled, {record['wall_s']:.1f} s")
        print(f"{total} kernels compiled, {wall_s:.1f} s")
    return 0


def list_hose_jobs() -> dict[str, Job]:
    """Hoses in a plane and in space, with every scheme, form of twist and kind of contact."""
    jobs: dict[str, Job] = {
        f"{where}, {scheme}": partial(_use_hose, plane=plane, scheme=scheme)
        for plane, where in (("xz", "in a plane"), (None, "in space"))
        for scheme in SCHEMES
    }
    jobs["in space, an angle at every control point"] = partial(_use_hose, twist="theta")
    jobs["in a plane, verlet"] = _use_verlet
    return jobs


def _make_hose(**options: Any) -> Any:
    from hose_mj.hoses.registry import make_hose
    from hose_mj.hoses.spec import HoseSpec

    spec = HoseSpec.from_material(
        length=1.0, youngs_modulus=1e6, poisson_ratio=0.45, density=1000.0, outer_radius=0.005
    )
    hose = make_hose("geds", spec, control_points=8, **options)
    hose.reset([[0, 0, 1], [1, 0, 1]])
    hose.clamp(0.0)
    return hose


def _use_hose(**options: Any) -> None:
    """Everything that a hose is asked for, once."""
    hose = _make_hose(timestep=0.002, **options)
    hold = hose.attach(1.0)
    hose.step(2)
    hose.move(hold, (0.999, 0.0, 1.0))
    hose.contacts.add_floor(0.0)
    hose.step(2)
    hose.apply_force(0.5, (0.0, 0.0, -0.1))
    hose.solve_static()
    hose.linearize()
    hose.energies(), hose.momentum(), hose.reaction(hold), hose.contacts.list_reactions()
    for query in (hose.position, hose.velocity, hose.tangent, hose.tension, hose.curvature):
        query([0.0, 0.5])


def _use_verlet() -> None:
    _make_hose(timestep=1e-5, plane="xz", scheme="verlet").step(2)


def list_world_jobs() -> dict[str, Job]:
    """Every shipped scene: a few steps with the monitor."""
    from hose_mj.scenes.mjcf.scene import list_scenes

    return {name: partial(_use_world, name) for name in list_scenes()}


def _use_world(scene: str) -> None:
    import numpy as np

    from hose_mj.constraints.monitor import Monitor
    from hose_mj.rollout.episode import run_episode
    from hose_mj.rollout.policies import make_policy
    from hose_mj.world.registry import make_world

    world, generator = make_world(scene), np.random.default_rng(0)
    run_episode(world, Monitor(world), make_policy("random"), duration=0.05, generator=generator)


def list_learn_jobs() -> dict[str, Job]:
    """Every task with a learner, and every learner on a task."""
    from hose_learning.learners import catalog

    from hose_mj.tasks.registry import TASKS

    pairs = {task: NAMED_LEARNERS.get(task, "d-rr-ql") for task in TASKS}
    jobs: dict[str, Job] = {
        f"task {task}": partial(_use_learner, task, id) for task, id in pairs.items()
    }
    for id, entry in catalog.LEARNERS.items():
        task = "taxi" if entry.schedule == "joint" else "corridor"
        jobs[f"learner {id}"] = partial(_use_learner, task, id)
    return jobs


def _use_learner(task_id: str, learner: str) -> None:
    import numpy as np
    from hose_learning.learners import catalog
    from hose_learning.study.training import Training

    from hose_mj.extras import MissingExtra
    from hose_mj.tasks.registry import make_task

    try:
        task = make_task(task_id)
        settings = catalog.make_settings(learner, task, None, None)
        training = Training(task, learner, settings, np.random.default_rng(0))
    except (InputError, MissingExtra):  # a pair that does not fit, or a part that is not here
        return
    training.advance(moves=10)
    training.test(1, max_moves=1)


GROUPS = {"hose": list_hose_jobs, "world": list_world_jobs, "learn": list_learn_jobs}
