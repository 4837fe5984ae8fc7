import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.recording.episode import HoseTrack, Scene, Series
from hose_mj.recording.palette import COLORS, find_color, find_model


def make_track(**changes):
    fields = dict(
        name="geds",
        arc_lengths=[0.0, 0.5, 1.0],
        times=[0.0, 0.1],
        points=np.zeros((2, 3, 3)),
        radius=0.01,
        color=COLORS["geds"],
    )
    return HoseTrack(**{**fields, **changes})


def test_a_track_keeps_its_own_locked_copy():
    points = np.zeros((2, 3, 3))
    track = make_track(points=points)
    points[:] = 7.0
    assert np.all(track.points == 0.0)
    with pytest.raises(ValueError, match="read-only"):
        track.points[0, 0, 0] = 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": np.zeros((2, 4, 3))}, "shape of track 'geds': points"),
        ({"points": np.full((2, 3, 3), np.nan)}, r"points\[0, 0, 0\]"),
        ({"points": "curve"}, "an array of numbers"),
        ({"times": [0.1, 0.1]}, r"times\[1\] is 0.1"),
        ({"times": []}, "k >= 1"),
        ({"arc_lengths": [0.0]}, "k >= 2"),
        ({"tension": np.zeros((2, 2))}, "tension"),
        ({"radius": 0.0}, "radius"),
        ({"radius": np.inf}, "radius"),
        ({"color": (0, 0, 256)}, "color"),
        ({"color": (0.5, 0.5, 0.5)}, "color"),
        ({"name": "  "}, "name of a track"),
        ({"name": "a\nb"}, "name of a track"),
    ],
)
def test_a_track_refuses(changes, message):
    with pytest.raises(InputError, match=message):
        make_track(**changes)


@pytest.mark.parametrize(
    "changes",
    [{"values": [1.0]}, {"values": [1.0, np.inf]}, {"times": [1.0, 0.0]}, {"limit": np.nan}],
)
def test_a_series_refuses(changes):
    with pytest.raises(InputError):
        Series(**{"name": "distance", "times": [0.0, 1.0], "values": [0.0, 1.0], **changes})


def test_a_scene_refuses_bad_names_repeats_and_emptiness():
    track = make_track()
    with pytest.raises(InputError, match="name of a scene"):
        Scene("tip load", "Tip load", (track,))
    with pytest.raises(InputError, match="at least one"):
        Scene("tip-load", "Tip load", ())
    with pytest.raises(InputError, match="geds"):
        Scene("tip-load", "Tip load", (track, track))


def test_labels_find_their_model():
    assert find_model("hinge-chain, 40") == "hinge-chain"
    assert find_model("GEDS 16") == "geds"
    assert find_model("cables") is None
    assert find_color("cable to geds") == COLORS["cable"]
    assert find_color("other", 0) != find_color("other", 1)
