"""Materials and ready hoses: every number has a source, and derived ones are derived again."""

from __future__ import annotations

import math
import tomllib

import pytest

from hose_mj.assets import find_asset
from hose_mj.errors import InputError
from hose_mj.hoses.materials import MATERIAL_KEYS, read_catalogue

MATERIALS, HOSES = read_catalogue().materials, read_catalogue().hoses


def gent(shore):
    """Young's modulus (Pa) from the Shore A hardness (Gent 1958)."""
    return 1e6 * 0.0981 * (56 + 7.62336 * shore) / (0.137505 * (254 - 2.54 * shore))


def second_moment(diameter):
    return math.pi * diameter**4 / 64


def area(diameter):
    return math.pi * diameter**2 / 4


def test_the_six_hoses_of_the_examples():
    assert set(HOSES) == {
        *("garden-hose-19mm", "fire-hose-45mm-dry", "usb-cable", "wire-rope-2mm"),
        *("suture-thread", "telephone-cord"),
    }


def test_every_number_has_a_source():
    with open(find_asset("materials.toml"), "rb") as stream:
        file = tomllib.load(stream)
    for kind, entries in (("materials", MATERIALS), ("hoses", HOSES)):
        for name, entry in entries.items():
            assert entry.title
            stated = {key for key, value in file[kind][name].items() if isinstance(value, dict)}
            assert stated <= set(entry.values)
            assert all(len(sourced.source) >= 5 for sourced in entry.values.values())
    for entry in MATERIALS.values():
        assert {"youngs_modulus", "poisson_ratio", "density"} <= set(entry.values)
        assert set(entry.values) <= set(MATERIAL_KEYS)
        assert 0.0 < entry.numbers["poisson_ratio"] <= 0.5


@pytest.mark.parametrize(("name", "shore"), [("plasticised-pvc", 75), ("cable-pvc", 85)])
def test_pvc(name, shore):
    pvc = MATERIALS[name].numbers
    assert pvc["youngs_modulus"] == pytest.approx(gent(shore), rel=2e-3)
    assert pvc["density"] == pytest.approx(160 / (100 / 1400 + 60 / 975), rel=1e-3)


def test_rubber():
    assert MATERIALS["rubber"].numbers["youngs_modulus"] == pytest.approx(gent(60), rel=2e-3)


def test_fire_hose_is_two_strips():
    hose, wide, thick = HOSES["fire-hose-45mm-dry"].numbers, math.pi * 0.045 / 2, 0.002
    modulus = MATERIALS["rubber"].numbers["youngs_modulus"]
    assert hose["bending_stiffness"] == pytest.approx(modulus * wide * thick**3 / 6, rel=1e-2)
    assert hose["second_bending_stiffness"] == pytest.approx(
        modulus * thick * wide**3 / 6, rel=1e-2
    )
    assert hose["torsional_stiffness"] == pytest.approx(
        2 * (modulus / 3) * wide * thick**3 / 3, rel=1e-2
    )
    assert hose["linear_density"] == pytest.approx(5.4 / 30.5 * 45 / 38, rel=1e-2)
    warp = hose["linear_density"] / 4 / 1380 * 10e9
    assert hose["axial_stiffness"] == pytest.approx(warp / 10, rel=1e-2)


def test_usb_cable_is_jacket_and_wires():
    hose, wire, wires = HOSES["usb-cable"].numbers, 0.127e-3, 35
    copper, pvc = MATERIALS["copper"].numbers, MATERIALS["cable-pvc"].numbers
    jacket = second_moment(4.5e-3) - second_moment(3.1e-3)
    shear = [m["youngs_modulus"] / 2 / (1 + m["poisson_ratio"]) for m in (copper, pvc)]
    bending = wires * copper["youngs_modulus"] * second_moment(wire)
    assert hose["bending_stiffness"] == pytest.approx(
        bending + pvc["youngs_modulus"] * jacket, rel=1e-2
    )
    twist = 2 * (wires * shear[0] * second_moment(wire) + shear[1] * jacket)
    assert hose["torsional_stiffness"] == pytest.approx(twist, rel=1e-2)
    ring = area(4.5e-3) - area(3.1e-3)
    assert hose["axial_stiffness"] == pytest.approx(
        wires * copper["youngs_modulus"] * area(wire) + pvc["youngs_modulus"] * ring, rel=1e-2
    )
    metal = wires * area(wire) + 96 * area(1e-4)
    plastic = ring + 4 * (area(0.9e-3) - area(0.381e-3))
    mass = metal * copper["density"] + plastic * pvc["density"]
    assert hose["linear_density"] == pytest.approx(mass, rel=1e-2)


def test_wire_rope_is_49_wires():
    hose, steel, wire = HOSES["wire-rope-2mm"].numbers, MATERIALS["steel"].numbers, 2e-3 / 9
    modulus = steel["youngs_modulus"]
    strand = 1 + 6 * math.cos(math.radians(14)) ** 3
    rope = 1 + 6 * math.cos(math.radians(17)) ** 3
    assert hose["axial_stiffness"] == pytest.approx(modulus * area(wire) * strand * rope, rel=1e-2)
    bending = 49 * modulus * second_moment(wire)
    assert hose["bending_stiffness"] == pytest.approx(bending, rel=1e-2)
    assert hose["torsional_stiffness"] == pytest.approx(bending / 1.3, rel=1e-2)
    assert hose["linear_density"] == pytest.approx(49 * area(wire) * steel["density"], rel=1e-2)


def test_telephone_cord_is_a_closed_coil():
    hose, radius, pitch = HOSES["telephone-cord"].numbers, 5e-3, 3.6e-3 / (2 * math.pi)
    assert hose["rest_curvature"] == pytest.approx(radius / (radius**2 + pitch**2), rel=1e-3)
    assert hose["rest_torsion"] == pytest.approx(pitch / (radius**2 + pitch**2), rel=1e-3)
    assert hose["outer_diameter"] == pytest.approx(2 * math.pi * pitch)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[materials.tin]\ntitle = 'Tin'\ndensity = 7.0", "materials.tin.density is 7.0; "),
        ("[materials.tin]\ndensity = { value = 7.0 }", "materials.tin.density.source is None; "),
        ("[materials.tin]\ndensity = { source = 'x' }", "materials.tin.density.value is None; "),
        ("[materials.tin]\nmass = { value = 1.0, source = 'x' }", "materials.tin.mass is "),
        (
            "[materials.tin]\ndensity = { value = 7.0, source = 'x' }\n"
            "[hoses.pipe]\nmaterial = 'lead'",
            "hoses.pipe.material is 'lead'; valid: one of tin",
        ),
    ],
)
def test_mistakes_in_a_catalogue(tmp_path, text, what):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_catalogue(path)
    assert what in str(caught.value)
