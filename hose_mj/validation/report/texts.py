"""Words of the page of `hose-mj compare` that do not depend on what was measured."""

from __future__ import annotations

from hose_mj.recording.page import Page
from hose_mj.validation.settings import CABLE_TWIST, FULL, LARGEST_STEP, QUICK, STAGNATION


def write_physics(page: Page) -> None:
    """The model of GEDS in brief, with its equations (docs/physics.md has all of it)."""
    section = page.section("The physics in brief")
    section.paragraph(
        "GEDS is a hose as a Geometrically Exact Dynamic Spline: its centre line is a cubic "
        "B-spline of the rest arc length, and the control points are the unknowns. No angle is "
        "taken to be small."
    )
    section.equation("r(s) = \u2211\u1d62 N\u1d62(s) p\u1d62 ,    0 \u2264 s \u2264 L", "1")
    section.paragraph(
        "**Strain energy** is that of stretching and of bending. The strain is one mean per span "
        "(\u0394 its length), because a strain forbidden at every point would lock the bending "
        "of a cubic; \u03bb is its linear part in the two end spans. The curvature is exact and "
        "needs no frame."
    )
    section.equation(
        "U = \u2211\u2091 \u00bd EA \u0394 (\u03b5\u0304\u2091\u00b2 + \u03bb\u2091\u00b2) + "
        "\u222b \u00bd EI |\u03ba|\u00b2 ds ,    "
        "\u03b5\u0304\u2091 = \u27e8|r\u2032|\u27e9\u2091 \u2212 1 ,    "
        "\u03ba = r\u2032 \u00d7 r\u2033 / |r\u2032|\u00b2",
        "2",
    )
    section.paragraph("The **mass** matrix is constant and banded; \u03c1 is the mass per length.")
    section.equation("M\u1d62\u2c7c = \u03c1 \u222b N\u1d62 N\u2c7c ds", "3")
    section.paragraph(
        "Every **stage** of an implicit scheme, of length h from a base (X, V), asks for the x "
        "of the equation below, with Kelvin-Voigt damping C, drag c, loads f and holds "
        "G\u00a0x\u00a0=\u00a0g whose multipliers \u03bb are the reactions. BDF2 has h = \u2154 "
        "dt, X\u00a0=\u00a0(4\u00a0x\u2099\u00a0\u2212\u00a0x\u2099\u208b\u2081)\u00a0/\u00a03, "
        "V likewise. Newton's matrix is banded, so a step costs O(n)."
    )
    section.equation(
        "M [ (x \u2212 X \u2212 hV) / h\u00b2 + c (x \u2212 X) / h ] + \u2202U/\u2202x + "
        "C(x) (x \u2212 X) / h \u2212 f \u2212 G\u1d40\u03bb = 0",
        "4",
    )
    section.paragraph("The whole of it is in `docs/physics.md`.")


def write_method(page: Page, quick: bool) -> None:
    """How the peers were treated, and the grid of settings."""
    section = page.section("How the peers were treated")
    for name, text in _FAIRNESS.items():
        section.paragraph(f"**{name}.** {text}")
    section.paragraph("More in `docs/mujoco_cable.md` and `docs/validation.md`.")
    grid = QUICK if quick else FULL
    fold = section.fold("The grid of settings")
    fold.definitions(
        {
            "GEDS control points": ", ".join(map(str, grid.dynamic["geds"])),
            "chain segments": ", ".join(map(str, grid.dynamic["hinge-chain"])),
            "GEDS schemes": "; ".join(grid.schemes["geds"]) + "; Newton tolerance 1e-3 L",
            "flex segments": ", ".join(map(str, grid.dynamic["flex"])),
            "cable integrators": ", ".join(grid.schemes["cable"]),
            "hinge-chain integrators": ", ".join(grid.schemes["hinge-chain"]),
            "flex integrator": ", ".join(grid.schemes["flex"]),
            "MuJoCo solver": "Newton, 100 iterations, tolerance 1e-8, the faster Jacobian: "
            "chains dense, flex sparse",
            "longest run scored": f"{grid.longest_run:g} s",
            "timing": f"least of {grid.rounds} rounds, all models in turn, one thread",
        }
    )


_FAIRNESS = {
    "Equal error": "Speeds mean nothing unless errors are equal. Each model runs on a grid of "
    "resolutions, integrators and time steps, and stands at each level with its cheapest setting "
    "within that error. Space is held against the cable and the flex, which move in space; the "
    "plane against the hinge chain.",
    "The clamp": "MuJoCo's documented clamp makes the whole first segment rigid, half a segment "
    "too late, which costs a first-order error. It is run as documented and with the segment "
    "centred on the end; ratios use the corrected clamp only.",
    "Time steps": f"Chains start at {1e3 * LARGEST_STEP:g} ms and halve their step until they are "
    f"stable, then until a halving takes less than {100 * STAGNATION:g} % off the error. The "
    f"cable's torsional stiffness is lowered to {CABLE_TWIST:g} EI in motions, all planar, which "
    "lets it take larger steps.",
    "References": "Chains do not stretch, so they are held against the limit of an inextensible "
    "hose, GEDS against the limit with its stiffness. Both are converged far beyond the runs "
    "they judge, and MuJoCo's own limit, extrapolated in its segments, has to agree with the "
    "former.",
    "Flex": "MuJoCo's 1-D flex takes bending implicitly, so its ladder begins where its error "
    "does; its edges stretch a little, which a check measures. No twist, and no promise on ratios.",
    "Statics": "MuJoCo has no static solver; the one used for its hoses is ours, so statics are "
    "held by error only, and against closed forms that know no hose model.",
}
