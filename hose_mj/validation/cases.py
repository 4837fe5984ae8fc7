"""The cases of `hose-mj compare`, as data: a hose, what is done to it, what is read off, the truth.

A case is `static` (an equilibrium, frequencies or a critical load, compared with a closed form) or
`dynamic` (a motion, compared with its converged limit). Add one by adding a record to `CASES`, or,
from another package, by an entry point in the group `hose_mj.cases`.
"""

import math
from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint

from hose_mj.errors import InputError
from hose_mj.plugins import find_plugins, load_plugin, load_plugins
from hose_mj.validation import knots, leaks, moorings, motions, ropes, statics
from hose_mj.validation.case import Case
from hose_mj.validation.reference import MOORINGS
from hose_mj.validation.trial import Trial

CASES: tuple[Case, ...] = (
    *(statics.make_heavy_cantilever(gamma) for gamma in (0.1, 1.0, 3.0, 10.0, 30.0, 100.0)),
    *(statics.make_tip_load(alpha) for alpha in (1.0, 2.0, 5.0, 10.0)),
    statics.make_end_moment(math.pi, "pi"),
    statics.make_end_moment(2.0 * math.pi, "2pi"),
    *(statics.make_frequencies(ends) for ends in ("clamped-free", "free-free", "clamped-pinned")),
    statics.make_hanging_chain(),
    statics.make_catenary(),
    *(statics.make_euler_buckling(ends) for ends in ("clamped-free", "pinned")),
    *(statics.make_bend(load) for load in (300.0, 600.0)),
    *(statics.make_ring(ratio) for ratio in (0.5, 0.75, 1.0, 1.25)),
    *(statics.make_greenhill(pull) for pull in (0.0, 10.0, 100.0)),
    statics.make_helix(),
    statics.make_coil(),
    *map(moorings.make_mooring, MOORINGS),
    moorings.make_current(),
    moorings.make_sinking(),
    motions.make_free_flight(),
    motions.make_released_rod(),
    motions.make_taut_pull(),
    motions.make_suture_pull(),
    motions.make_capstan(),
    motions.make_held_capstan(),
    motions.make_floor_tow(),
    motions.make_obstacle_drop(),
)

TRIALS: tuple[Trial, ...] = (
    Trial("slack-wire", ropes.measure_slack_wire),
    Trial("whirling-rope", ropes.measure_whirling_rope),
    Trial("post-pull", leaks.measure_post_pull),
    Trial("bar-drop", leaks.measure_bar_drop),
    Trial("knot", knots.measure_knot),
    Trial("plectoneme", knots.measure_plectoneme),
)
"""What GEDS goes through alone."""


@cache
def list_plugin_cases() -> tuple[Case, ...]:
    """Returns the cases of other packages: what their entry points in `hose_mj.cases` name.

    An entry point is a `Case`, or a callable without arguments that returns some.

    One that cannot be imported or is neither, or whose ids are taken, is left out with a warning.
    """
    cases: list[Case] = []

    def add(entry: EntryPoint) -> None:
        loaded = load_plugin(entry, (Case, Callable))  # type: ignore[arg-type]
        added = [loaded] if isinstance(loaded, Case) else list(loaded())
        for case in added:
            if not isinstance(case, Case):
                valid = "a Case, or a callable that returns a list of Case"
                raise InputError(f"entry point {entry.name!r} in hose_mj.cases", case, valid)
            if any(case.id == other.id for other in (*CASES, *cases)):
                what = f"id of a case of entry point {entry.name!r}"
                raise InputError(what, case.id, "an id of its own")
        cases.extend(added)

    load_plugins(find_plugins("hose_mj.cases"), add)
    return tuple(cases)


def find_trials(ids: tuple[str, ...]) -> tuple[Trial, ...]:
    """Returns the trials of these ids, in the order of `TRIALS`; all without ids."""
    return tuple(trial for trial in TRIALS if not ids or trial.id in ids)


def find_cases(ids: tuple[str, ...]) -> tuple[Case, ...]:
    """Returns the cases of these ids, in the order of `CASES`; a family's name selects all of it.

    Ids of trials select none.

    Without ids all of `CASES`; those of other packages (`list_plugin_cases`) run when asked for.
    `InputError` is raised for an id that is neither a case nor a family.
    """
    if not ids:
        return CASES
    known = CASES
    trials = [trial.id for trial in TRIALS]
    ids = tuple(name for name in ids if name not in trials)
    if any(all(name not in (case.id, case.family) for case in CASES) for name in ids):
        known = (*CASES, *list_plugin_cases())
    for name in ids:
        if not any(name in (case.id, case.family) for case in known):
            families = list(dict.fromkeys(case.family for case in known))
            valid = f"{', '.join([*families, *trials])}, or one with its parameter"
            raise InputError("case", name, valid)
    return tuple(case for case in known if {case.id, case.family} & set(ids))
