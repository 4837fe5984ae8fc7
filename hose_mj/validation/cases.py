"""The cases of `hose-mj compare`, as data: a hose, what is done to it, what is read off, the truth.

A case is `static` (an equilibrium, frequencies or a critical load, compared with a closed form) or
`dynamic` (a motion, compared with its converged limit). Add one by adding a record to `CASES`.
"""

from __future__ import annotations

import math

from hose_mj.errors import InputError
from hose_mj.validation.case import Case
from hose_mj.validation.contacts import make_capstan, make_floor_tow, make_obstacle_drop
from hose_mj.validation.motions import (
    make_free_flight,
    make_released_rod,
    make_suture_pull,
    make_taut_pull,
)
from hose_mj.validation.statics import (
    make_catenary,
    make_end_moment,
    make_euler_buckling,
    make_frequencies,
    make_hanging_chain,
    make_heavy_cantilever,
    make_tip_load,
)
from hose_mj.validation.twisted import (
    make_bend,
    make_coil,
    make_greenhill,
    make_helix,
    make_ring,
)

CASES: tuple[Case, ...] = (
    *(make_heavy_cantilever(gamma) for gamma in (0.1, 1.0, 3.0, 10.0, 30.0, 100.0)),
    *(make_tip_load(alpha) for alpha in (1.0, 2.0, 5.0, 10.0)),
    make_end_moment(math.pi, "pi"),
    make_end_moment(2.0 * math.pi, "2pi"),
    *(make_frequencies(ends) for ends in ("clamped-free", "free-free", "clamped-pinned")),
    make_hanging_chain(),
    make_catenary(),
    *(make_euler_buckling(ends) for ends in ("clamped-free", "pinned")),
    *(make_bend(load) for load in (300.0, 600.0)),
    *(make_ring(ratio) for ratio in (0.5, 0.75, 1.0, 1.25)),
    *(make_greenhill(pull) for pull in (0.0, 10.0, 100.0)),
    make_helix(),
    make_coil(),
    make_free_flight(),
    make_released_rod(),
    make_taut_pull(),
    make_suture_pull(),
    make_capstan(),
    make_floor_tow(),
    make_obstacle_drop(),
)


def find_cases(ids: tuple[str, ...]) -> tuple[Case, ...]:
    """Returns the cases of these ids, in the order of `CASES`; a family's name selects all of it.

    Raises:
        InputError: an id that is neither a case nor a family.
    """
    for name in ids:
        if not any(name in (case.id, case.family) for case in CASES):
            families = list(dict.fromkeys(case.family for case in CASES))
            raise InputError("case", name, f"{', '.join(families)}, or one with its parameter")
    return tuple(case for case in CASES if not ids or {case.id, case.family} & set(ids))
