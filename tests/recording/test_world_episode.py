import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hose_mj.errors import InputError
from hose_mj.recording.palette import color_tension
from hose_mj.recording.scene_description import Geom, Margin, SceneDescription
from hose_mj.recording.world_episode import BreakMark, SampleBuffer


def make_geom(**changed):
    values = {
        "name": "ball", "kind": "sphere", "size": [0.1, 0, 0], "color": (200, 0, 0, 255),
        "body": 0, "position": [0, 0, 0], "quaternion": [1, 0, 0, 0],
    }  # fmt: skip
    return Geom(**(values | changed))


def make_scene(**changed):
    values = {
        "name": "geds", "title": "A scene", "geoms": (make_geom(),), "bodies": ("puck",),
        "robots": ("robot0",), "goal": make_geom(name="goal", body=-1), "arc_lengths": [0, 0.5, 1],
        "hose_radius": 0.01, "tension_limit": 10.0,
        "margins": (Margin("stretch 0", "stretch", "N"),),
        "n_control_points": 4, "low": [0, 0, 0], "high": [1, 1, 0.1], "source": [0, 0, 0],
        "bounds": [[0, 0, -np.inf], [1, 1, np.inf]],
    }  # fmt: skip
    return SceneDescription(**(values | changed))


@pytest.mark.parametrize(
    ("make", "changed", "message"),
    [
        (make_geom, {"kind": "cone"}, "ball.*kind.*ellipsoid"),
        (make_geom, {"size": [np.nan, 0, 0]}, "ball.*size"),
        (make_geom, {"color": (256, 0, 0, 0)}, "ball.*color"),
        (make_geom, {"kind": "mesh"}, "ball.*vertices"),
        (make_geom, {"kind": "mesh", "vertices": np.eye(3), "faces": [[0, 1, 3]]}, "ball.*faces"),
        (make_scene, {"geoms": (make_geom(body=1),)}, "body of geom 'ball'"),
        (make_scene, {"geoms": (make_geom(), make_geom())}, "geoms.*ball"),
        (make_scene, {"tension_limit": 0.0}, "tension_limit"),
        (make_scene, {"arc_lengths": [0, 0]}, "arc_lengths"),
        (make_scene, {"high": [0, 0, 0]}, "low"),
    ],
)
def test_what_cannot_be_in_a_scene_is_named(make, changed, message):
    with pytest.raises(InputError, match=message):
        make(**changed)


@given(st.integers(2, 20), st.integers(1, 200))
def test_a_long_episode_is_kept_whole_but_coarser(most, n):
    buffer = SampleBuffer(make_scene(), most)
    for k in range(n):
        buffer.append(event=str(k), time=0.1 * k)
    samples = buffer.copy()
    assert len(samples) <= most
    assert samples.times[0] == 0.0
    assert samples.times[-1] == 0.1 * (n - 1)
    numbers = [int(event) for event in samples.events]
    np.testing.assert_array_equal(samples.times, 0.1 * np.array(numbers))
    steps = np.diff(numbers[:-1])  # the last one is kept in any case
    assert len(set(steps)) <= 1
    if n <= most:
        assert numbers == list(range(n))
    elif len(steps):
        assert steps[0] <= 2 * n / (most - 1)


def test_a_second_sample_of_one_time_replaces_the_first():
    buffer = SampleBuffer(make_scene())
    buffer.append("a", time=0.0)
    buffer.append("b", time=0.1, reward=1.0)
    buffer.append("c", time=0.1, reward=2.0)
    samples = buffer.take()
    assert samples.owners == ("a", "c")
    assert samples.rows["reward"].tolist() == [0.0, 2.0]
    assert len(buffer) == 0


def test_a_sample_that_is_not_finite_is_named_but_for_margins():
    buffer = SampleBuffer(make_scene())
    buffer.append(time=0.0, margins=[np.nan])
    buffer.copy()
    buffer.append(time=0.1, tension=[0.0, np.inf, 0.0])
    with pytest.raises(InputError, match="tension of sample 1"):
        buffer.copy()


def test_a_break_has_a_place_and_a_time():
    with pytest.raises(InputError, match="place"):
        BreakMark("stretch", 1.0, [0.0, 0.0], "text")
    with pytest.raises(InputError, match="time"):
        BreakMark("stretch", np.nan, [0.0, 0.0, 0.0], "text")


def test_colors_of_tension_run_from_blue_over_pale_to_red():
    colors = color_tension(np.array([-100.0, 0.0, 10.0, 1000.0]), 10.0).astype(int)
    assert colors[0, 2] > 2 * colors[0, 0]
    assert colors[1].min() > 200
    assert colors[2, 0] > 4 * colors[2, 2]
    np.testing.assert_array_equal(colors[2], colors[3])
