"""HoseSpec: one name for the outer radius, one default of GJ by every road, ready hoses."""

from __future__ import annotations

import math
import pickle
import shutil
from dataclasses import asdict, replace

import numpy as np
import pytest

from hose_mj.assets import find_assets
from hose_mj.errors import InputError
from hose_mj.hoses.spec import Fitting, HoseSpec
from hose_mj.scenes.hose_file.hose_file import read_hose_file
from hose_mj.scenes.mjcf.scene import read_scene

PLAIN = {"length": 2.0, "axial_stiffness": 5e3, "bending_stiffness": 5e-3, "linear_density": 0.15}
TOML = """
[hose]
{hose}
[[holds]]
at = "start"
kind = "clamp"
position = [0.0, 0.0, 1.0]
tangent = [1.0, 0.0, 0.0]
"""


def read_toml_spec(folder, hose):
    file = folder / "hose.toml"
    file.write_text(TOML.format(hose=hose))
    return read_hose_file(file).spec


def read_mjcf_spec(folder, old="", new=""):
    """The hose of a shipped scene, a piece of its text replaced."""
    scenes = folder / "scenes"
    shutil.copytree(find_assets() / "scenes", scenes, dirs_exist_ok=True)
    floor = scenes / "parts" / "floor.xml"
    text = floor.read_text()
    assert old in text
    floor.write_text(text.replace(old, new))
    return read_scene(scenes / "floor_1.xml").spec


def test_torsional_stiffness_is_that_of_a_round_section_unless_stated():
    assert HoseSpec(**PLAIN).torsional_stiffness == 5e-3 / 1.3
    assert HoseSpec(**PLAIN, torsional_stiffness=None).torsional_stiffness == 5e-3 / 1.3
    assert HoseSpec(**PLAIN, torsional_stiffness=0.0).torsional_stiffness == 0.0
    tube = HoseSpec.from_material(
        length=1.0, youngs_modulus=1e7, poisson_ratio=0.3, density=1e3, outer_radius=0.01
    )
    unstated = replace(tube, torsional_stiffness=None)
    assert unstated.torsional_stiffness == pytest.approx(tube.torsional_stiffness, rel=1e-15)
    with pytest.raises(InputError, match="bending_stiffness is -1"):
        HoseSpec(**PLAIN | {"bending_stiffness": -1.0})


def test_the_default_is_the_same_by_every_road(tmp_path):
    lines = "\n".join(f"{key} = {value}" for key, value in PLAIN.items())
    radius = "outer_radius = 0.01"
    assert read_toml_spec(tmp_path, f"{lines}\n{radius}") == HoseSpec(**PLAIN)
    free = read_toml_spec(tmp_path, f"{lines}\n{radius}\ntorsional_stiffness = 0")
    assert free == HoseSpec(**PLAIN, torsional_stiffness=0.0)
    line = '<numeric name="hose_torsional_stiffness" data="4e-3"/>'
    scene = read_mjcf_spec(tmp_path, line, "")
    assert scene.torsional_stiffness == HoseSpec(
        length=1.0, axial_stiffness=1.0, bending_stiffness=scene.bending_stiffness,
        linear_density=1.0,
    ).torsional_stiffness  # fmt: skip
    assert read_mjcf_spec(tmp_path, "4e-3", "0").torsional_stiffness == 0.0


def test_a_poisson_ratio_that_is_given_counts(tmp_path):
    lines = "\n".join(f"{key} = {value}" for key, value in PLAIN.items())
    spec = read_toml_spec(tmp_path, f"{lines}\nouter_radius = 0.01\npoisson_ratio = 0.5")
    assert spec.torsional_stiffness == 5e-3 / 1.5


def test_radius_is_the_old_name_of_outer_radius():
    with pytest.warns(DeprecationWarning, match="write outer_radius") as caught:
        old = HoseSpec(**PLAIN, radius=0.02)
    assert caught[0].filename == __file__
    assert old == HoseSpec(**PLAIN, outer_radius=0.02)
    with pytest.warns(DeprecationWarning, match="write outer_radius") as caught:
        assert old.radius == 0.02
    assert caught[0].filename == __file__
    assert replace(old, outer_radius=0.03).outer_radius == 0.03
    with pytest.warns(DeprecationWarning, match="write outer_radius"):
        assert replace(old, radius=0.03).outer_radius == 0.03
    assert pickle.loads(pickle.dumps(old)) == old
    with pytest.raises(TypeError, match="diameter"):
        HoseSpec(**PLAIN, diameter=0.02)


def test_a_scene_says_hose_outer_radius_and_once_said_hose_radius(tmp_path):
    spec = read_mjcf_spec(tmp_path)
    with pytest.warns(DeprecationWarning, match="hose_radius is deprecated: write hose_outer_rad"):
        assert read_mjcf_spec(tmp_path, "hose_outer_radius", "hose_radius") == spec
    line = '<numeric name="hose_outer_radius"'
    both = '<numeric name="hose_radius" data="0.008"/>' + line
    with pytest.raises(InputError, match=r"numeric hose_radius is 0\.008; valid: left out"):
        read_mjcf_spec(tmp_path, line, both)


@pytest.mark.parametrize("name", HoseSpec.list_ready())
def test_a_ready_hose_is_that_of_a_file(name, tmp_path):
    spec = HoseSpec.ready(name, length=3.0)
    assert spec == read_toml_spec(tmp_path, f'length = 3.0\nlike = "{name}"')
    assert HoseSpec.list_ready()[name]


def test_an_unknown_ready_hose_is_refused():
    with pytest.raises(InputError, match="ready hose is 'garden'; valid: one of garden-hose-19mm"):
        HoseSpec.ready("garden", length=1.0)
    with pytest.raises(InputError, match="length is 0; valid: a finite number above 0"):
        HoseSpec.ready("usb-cable", length=0)


def test_what_no_float_holds_is_no_number():
    for length in (10**400, -(10**400), math.inf, math.nan):
        with pytest.raises(InputError, match="length is"):
            HoseSpec.ready("garden-hose-19mm", length=length)


@pytest.mark.parametrize("fittings", [3, (3,), [Fitting(start=0.0, end=0.1)]])
def test_fittings_are_a_tuple_of_fittings(fittings):
    with pytest.raises(InputError, match="valid: a tuple of Fitting"):
        replace(HoseSpec.ready("garden-hose-19mm", length=1.0), fittings=fittings)


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64])
def test_numbers_of_numpy_are_stored_as_floats(kind):
    spec = HoseSpec(**{name: kind(3) for name in PLAIN})
    assert spec == HoseSpec(**dict.fromkeys(PLAIN, 3.0))
    assert all(type(getattr(spec, name)) is float for name in PLAIN)
    assert type(Fitting(start=kind(0), end=kind(1)).end) is float
    tube = HoseSpec.from_material(
        length=1, youngs_modulus=kind(9), poisson_ratio=0, density=kind(9), outer_radius=kind(2)
    )
    assert type(tube.linear_density) is float


ODD = [1j, {}, set(), "1", None, True, np.True_, np.ones(1), 10**5000]


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: type(odd).__name__)
@pytest.mark.parametrize("name", PLAIN)
def test_what_is_no_number_is_refused_by_name(name, odd):
    with pytest.raises(InputError, match=f"^{name} is .*; valid: a finite number (at or )?above 0"):
        HoseSpec(**PLAIN | {name: odd})


def test_a_default_gj_follows_ei_and_one_that_was_given_stays():
    default, given = HoseSpec(**PLAIN), HoseSpec(**PLAIN, torsional_stiffness=5e-3 / 1.3)
    assert default == given
    assert hash(default) == hash(given)
    assert repr(default) == repr(given)
    assert asdict(default) == asdict(given)
    for spec in (default, pickle.loads(pickle.dumps(default)), replace(default, length=1.0)):
        stiff = replace(spec, bending_stiffness=1.3)
        assert stiff.torsional_stiffness == 1.0
        assert replace(stiff, bending_stiffness=2.6).torsional_stiffness == 2.0
        own = replace(spec, bending_stiffness=1.3, torsional_stiffness=7.0)
        assert replace(own, bending_stiffness=2.6).torsional_stiffness == 7.0
    for spec in (given, pickle.loads(pickle.dumps(given)), HoseSpec(**asdict(default))):
        assert replace(spec, bending_stiffness=1.3).torsional_stiffness == 5e-3 / 1.3
