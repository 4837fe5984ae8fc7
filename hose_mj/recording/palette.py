"""One colour per hose model, the same in plots, reports and the viewer; colours of the tension.

The models' colours are Okabe and Ito's: readers with any common colour blindness tell them apart,
on white paper as well as on the viewer's dark ground. A model that is not listed, such as one of a
plug-in, has a spare colour.
"""

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[int, int, int]  # red, green, blue, each 0 to 255

COLORS: dict[str, Rgb] = {
    "geds": (0, 114, 178),
    "geds planar": (86, 180, 233),
    "cable": (213, 94, 0),
    "flex": (0, 158, 115),
    "hinge-chain": (204, 121, 167),
    "reference": (127, 127, 127),
}
MARKERS: dict[str, str] = dict(zip(COLORS, "ovs^Dx", strict=True))
NAMES: dict[str, str] = {
    "geds": "GEDS",
    "geds planar": "GEDS planar",
    "cable": "MuJoCo cable",
    "flex": "MuJoCo flex",
    "hinge-chain": "MuJoCo hinge chain",
}
LIMIT: Rgb = (160, 40, 40)
OTHERS: tuple[Rgb, ...] = ((230, 159, 0), (0, 114, 178), (120, 94, 200), (100, 100, 60))

LOWEST_TENSION = -0.25  # lowest tension that has a colour of its own, as a fraction of the limit
_FRACTIONS = np.array([LOWEST_TENSION, 0.0, 0.35, 0.7, 1.0])
_TENSION_COLORS = np.array(
    [[60, 120, 230], [214, 222, 230], [248, 214, 70], [244, 130, 30], [214, 30, 40]],
    dtype=np.float64,
)
"""Blue for pushed, pale for slack, yellow to red for pulled."""


def find_model(label: str) -> str | None:
    """Returns the model id that a label starts with ("cable, 40 segments" -> "cable"), or None."""
    for model in sorted(COLORS, key=len, reverse=True):
        rest = label.lower()[len(model) :]
        if label.lower().startswith(model) and not rest[:1].isalnum():
            return model
    return None


def find_color(label: str, position: int = 0) -> Rgb:
    """Returns the colour of a label's model; without a model, the spare colour at `position`."""
    model = find_model(label)
    return COLORS[model] if model is not None else OTHERS[position % len(OTHERS)]


def name_model(label: str) -> str:
    """Returns a label with its model's id replaced by the name that people read."""
    model = find_model(label)
    return label if model is None else NAMES.get(model, model) + label[len(model) :]


def mix(color: Rgb, other: Rgb, share: float) -> Rgb:
    """Returns a colour with a share (0 to 1) of another one in it."""
    red, green, blue = (
        round((1.0 - share) * a + share * b) for a, b in zip(color, other, strict=True)
    )
    return red, green, blue


def darken(color: Rgb, share: float = 0.3) -> Rgb:
    """Returns a colour with black in it, so that small text in it reads well on white."""
    return mix(color, (0, 0, 0), share)


def lighten(color: Rgb, share: float) -> Rgb:
    """Returns a colour with white in it."""
    return mix(color, (255, 255, 255), share)


def format_hex(color: Rgb) -> str:
    """Returns "#rrggbb"."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def color_tension(tension: NDArray[np.float64], limit: float) -> NDArray[np.uint8]:
    """Returns red, green, blue of tensions (...), N, shape (..., 3); `limit` (N) is red."""
    fractions = np.asarray(tension, dtype=np.float64) / limit
    parts = [np.interp(fractions, _FRACTIONS, _TENSION_COLORS[:, k]) for k in range(3)]
    return np.stack(parts, axis=-1).round().astype(np.uint8)


def make_tension_scale(limit: float) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Returns the colours from lowest to limit, (400, 3), and round tensions to label, N."""
    colors = color_tension(np.linspace(LOWEST_TENSION * limit, limit, 400), limit)
    return colors, limit * np.array([LOWEST_TENSION, 0.0, 0.25, 0.5, 0.75, 1.0])
