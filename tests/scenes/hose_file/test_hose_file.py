"""A user's hose in TOML: what it means, and one clear error for each mistake."""

from __future__ import annotations

import copy
import math
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hose_mj.assets import find_assets
from hose_mj.errors import InputError
from hose_mj.hoses.spec import HoseSpec
from hose_mj.scenes.hose_file.grasps import turn_towards
from hose_mj.scenes.hose_file.hose_file import compute_place_on_line, read_hose_file
from hose_mj.toml_table import LARGEST_FILE

EXAMPLES = sorted(find_assets().glob("hoses/*.toml"))
HOSE = """
[hose]
length = 2.0
axial_stiffness = 2e4
bending_stiffness = 0.05
linear_density = 0.1
outer_radius = 0.01
"""
HOLD = """
[[holds]]
at = "start"
kind = "clamp"
position = [0, 0, 1]
tangent = [2, 0, 0]
"""
END = """
[[holds]]
at = "end"
kind = "attach"
position = [1.5, 0.0, 1.0]
"""


@pytest.fixture
def read(tmp_path):
    """Reads a text as a user's file "mine.toml"."""

    def read_text(text):
        path = tmp_path / "mine.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_hose_file(path)

    return read_text


def test_six_examples_are_read():
    assert [path.stem for path in EXAMPLES] == [
        *("fire_hose", "garden_hose", "suture_thread", "telephone_cord", "usb_cable", "wire_rope"),
    ]
    for path in EXAMPLES:
        user = read_hose_file(path)
        assert user.title
        assert user.holds


def test_what_is_left_out_has_a_default(read):
    user = read(HOSE + HOLD)
    assert user.title == "mine"
    assert user.gravity == (0.0, 0.0, -9.81)
    assert user.errors == (0.01, 0.001)
    assert user.duration is user.floor is user.shape is None
    assert not user.moves
    assert not user.spins
    (hold,) = user.holds
    assert (hold.arc_length, hold.position, hold.tangent) == (0.0, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    # Nothing is known of the torsional stiffness: that of a round section with nu = 0.3.
    assert user.spec.torsional_stiffness == pytest.approx(0.05 / 1.3)


def test_a_section_and_a_material_make_the_stiffnesses(read):
    text = "[hose]\nlength = 2\nmaterial = 'steel'\nouter_diameter = 0.02\ninner_diameter = 0.01\n"
    tube = HoseSpec.from_material(
        length=2.0,
        youngs_modulus=210e9,
        poisson_ratio=0.3,
        density=7850.0,
        outer_radius=0.01,
        inner_radius=0.005,
    )
    assert read(text + HOLD).spec == tube
    water = read(text + "contents_density = 1000\n" + HOLD).spec
    full = tube.linear_density + 1000.0 * math.pi * 0.005**2
    assert water.linear_density == pytest.approx(full)
    assert read(text + "bending_stiffness = 3.0\n" + HOLD).spec.bending_stiffness == 3.0
    soft = read(text + "youngs_modulus = 210e6\n" + HOLD).spec
    assert soft.axial_stiffness == pytest.approx(1e-3 * tube.axial_stiffness)


def test_a_ready_hose_and_the_mass_of_the_whole(read):
    user = read("[hose]\nlike = 'usb-cable'\nlength = 1\n" + HOLD)
    assert user.spec.bending_stiffness == 2.64e-4
    heavy = read(HOSE.replace("linear_density = 0.1", "mass = 0.5") + HOLD)
    assert heavy.spec.linear_density == 0.25


def test_fittings(read):
    user = read(HOSE + "[[hose.fittings]]\nstart = 0.0\nend = 0.1\nbending_stiffness = 5\n" + HOLD)
    (fitting,) = user.spec.fittings
    assert (fitting.start, fitting.end, fitting.bending_stiffness) == (0.0, 0.1, 5.0)
    assert fitting.axial_stiffness is None


def test_holds_move_and_turn_in_time(read):
    user = read(
        HOSE
        + HOLD
        + "spin = { turns = 2, duration = 1.0 }\n"
        + "move = { tangent = [0, 0, 1], start = 1.0, duration = 1.0, profile = 'linear' }\n"
        + END
        + "[[holds.move]]\nto = [0.5, 0, 1]\nduration = 2.0\n"
        + "[[holds.move]]\nto = [0.5, 1, 1]\nstart = 3.0\nduration = 1.0\nprofile = 'linear'\n"
    )
    clamp, end = user.holds
    assert user.duration == 4.0
    assert user.start == "equilibrium"
    assert clamp.angle_at(0.5) == pytest.approx(2 * math.pi)
    assert clamp.angle_at(9.0) == pytest.approx(4 * math.pi)
    assert clamp.tangent_at(1.0) == (1.0, 0.0, 0.0)
    assert clamp.tangent_at(1.5) == pytest.approx((math.sqrt(0.5), 0.0, math.sqrt(0.5)))
    assert clamp.tangent_at(5.0) == pytest.approx((0.0, 0.0, 1.0))
    assert end.position_at(0.0) == (1.5, 0.0, 1.0)
    # Half a cosine: a quarter of the time goes sin^2(pi / 8) of the way.
    assert end.position_at(0.5)[0] == pytest.approx(1.5 - math.sin(math.pi / 8) ** 2)
    assert end.position_at(2.5) == pytest.approx((0.5, 0.0, 1.0))
    assert end.position_at(3.25) == pytest.approx((0.5, 0.25, 1.0))
    assert end.position_at(9.0) == pytest.approx((0.5, 1.0, 1.0))


unit = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: math.hypot(*v) > 0.1)
unit = unit.map(lambda v: tuple(x / math.hypot(*v) for x in v))


@given(unit, unit, st.floats(0, 1))
def test_a_tangent_turns_evenly_on_a_great_circle(one, other, share):
    turned = turn_towards(one, other, share)
    assert math.hypot(*turned) == pytest.approx(1.0)
    whole = math.atan2(math.dist(one, other), math.dist(one, [-x for x in other]))
    part = math.atan2(math.dist(one, turned), math.dist(one, [-x for x in turned]))
    assert part == pytest.approx(share * whole, abs=1e-7)


def test_a_tangent_turns_round():
    assert turn_towards((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), 1.0) == pytest.approx((0, 0, -1))
    assert turn_towards((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), 0.5)[2] == pytest.approx(0.0)


def test_a_place_on_a_line():
    corner = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 3.0, 0.0))
    assert compute_place_on_line(corner, 0.0) == (0.0, 0.0, 0.0)
    assert compute_place_on_line(corner, 0.125) == (0.5, 0.0, 0.0)
    assert compute_place_on_line(corner, 0.5) == (1.0, 1.0, 0.0)
    assert compute_place_on_line(corner, 1.0) == (1.0, 3.0, 0.0)


MOVE = "move = { to = [1.9, 0, 1], duration = 1 }\n"
MISTAKES = [
    ("", "hose is None; valid: a table [hose]"),
    ("[hose]\n", "hose.length is None; valid: a number from 0.001 to 10000"),
    ("[hose]\nlength = 2\n", "hose.axial_stiffness is None; valid: EA in N"),
    (HOSE.replace("length = 2.0", "length = '2 m'"), "hose.length is '2 m'; valid: a number"),
    (HOSE.replace("length = 2.0", "length = true"), "hose.length is True; valid: a number"),
    (HOSE.replace("length = 2.0", "length = nan"), "hose.length is nan; valid: a number"),
    (HOSE.replace("length = 2.0", "length = 0.01"), "hose.outer_radius is 0.01; valid: at most"),
    (HOSE.replace("bending", "bendy"), "hose.bendy_stiffness is 0.05; valid: a key among "),
    (HOSE.replace("0.05", "-0.05"), "hose.bending_stiffness is -0.05; valid: a number above 0"),
    (HOSE + "mass = 1.0\n", "hose.mass is 1.0; valid: left out where linear_density is given"),
    (HOSE + "rest_strain = -2\n", "hose.rest_strain is -2.0; valid: a number above -1"),
    (HOSE + "like = 'noodle'\n", "hose.like is 'noodle'; valid: one of garden-hose-19mm"),
    (HOSE + "material = 'noodle'\n", "hose.material is 'noodle'; valid: one of plasticised-pvc"),
    (
        "[hose]\nlength = 1\nmaterial = 'steel'\nouter_diameter = 0.01\ninner_diameter = 0.01\n",
        "hose.inner_diameter is 0.01; valid: below outer_diameter, 0.01 m",
    ),
    (
        HOSE + "[[hose.fittings]]\nstart = 0.5\nend = 0.4\n",
        "hose.fittings[0].end is 0.4; valid: a number above 0.5 to 2",
    ),
    (
        HOSE + "[[hose.fittings]]\nstart = 0\nend = 1\n[[hose.fittings]]\nstart = 0.5\nend = 1\n",
        "hose.fittings is (0.5, 1.0); valid: stretches",
    ),
    (HOSE, "holds is None; valid: one hold or more, or study.start = 'as-laid'"),
    (HOSE + "holds = 3\n", "hose.holds is 3; valid: a key among "),
    ("holds = [3]\n" + HOSE, "holds is [3]; valid: tables, [[holds]]"),
    (HOSE + "[[holds]]\nkind = 'clamp'\n", "holds[0].at is None; valid: a number from 0 to 2"),
    (HOSE + HOLD.replace("start", "middle"), "holds[0].at is 'middle'; valid: one of start, end"),
    (HOSE + HOLD.replace('"start"', "2.1"), "holds[0].at is 2.1; valid: a number from 0 to 2"),
    (HOSE + HOLD.replace("clamp", "glue"), "holds[0].kind is 'glue'; valid: one of clamp, attach"),
    (HOSE + HOLD.replace("kind", "# kind"), "holds[0].kind is None; valid: clamp, which"),
    (HOSE + HOLD.replace("[0, 0, 1]", "[0, 1]"), "holds[0].position is [0, 1]; valid: three"),
    (HOSE + HOLD.replace("[0, 0, 1]", "[0, 0, 1e6]"), "valid: three numbers within 100000 m"),
    (HOSE + HOLD.replace("tangent", "# "), "holds[0].tangent is None; valid: three numbers"),
    (HOSE + HOLD.replace("[2, 0, 0]", "[0, 0, 0]"), "holds[0].tangent is [0.0, 0.0, 0.0]; valid"),
    (HOSE + END + "tangent = [1, 0, 0]\n", "holds[0].tangent is [1.0, 0.0, 0.0]; valid: left out"),
    (HOSE + END + "spin = { turns = 1, duration = 1 }\n", "holds[0].spin is 'given'; valid: left"),
    (HOSE + HOLD + HOLD, "holds[1].at is 0.0; valid: a place that no other hold is at"),
    (
        HOSE + HOLD + END.replace("1.5", "2.5"),
        "holds[1].position is [2.5, 0.0, 1.0]; valid: within 2 m, the hose between them",
    ),
    (HOSE + HOLD + END + MOVE.replace("1.9", "2.1"), "holds[1].position at "),
    (HOSE + HOLD + END + "move = { duration = 1 }\n", "holds[1].move[0].to is None; valid: "),
    (HOSE + HOLD + END + "move = { to = [0, 0, 0] }\n", "holds[1].move[0].duration is None"),
    (
        HOSE + HOLD + END + MOVE.replace("= 1 }", "= 1, profile = 'fast' }"),
        "holds[1].move[0].profile is 'fast'; valid: one of smooth, linear",
    ),
    (
        HOSE + HOLD + END + "".join(["[[holds.move]]\nto = [1, 0, 1]\nduration = 1\n"] * 2),
        "holds[1].move.start is 0.0; valid: at or after the end of the one before, 1 s",
    ),
    ("loads = 1\n" + HOSE + HOLD, "loads is 1; valid: a table, [loads]"),
    (HOSE + HOLD + "[loads]\ngravity = 9.81\n", "loads.gravity is 9.81; valid: three numbers"),
    (HOSE + HOLD + "[loads]\ngravity = [0, 0, 1e5]\n", "valid: three numbers up to 1e4"),
    (HOSE + HOLD + "[[loads.points]]\nat = 1\n", "loads.points[0].force is None; valid: a force"),
    (HOSE + HOLD + "[floor]\nfriction = -1\n", "floor.friction is -1; valid: a number from 0"),
    ("shape = [[0, 0, 0]]\n" + HOSE + HOLD, "shape is [[0, 0, 0]]; valid: two or more points"),
    ("shape = [[0, 0, 1], [1, 0, 1]]\n" + HOSE + HOLD, "shape is 'a line of 1 m'; valid: points"),
    ("shape = [[0, 0, 0], [2, 0, 0]]\n" + HOSE + HOLD, "shape is [0.0, 0.0, 0.0]; valid: a line"),
    (HOSE + HOLD + "[study]\nduration = -1\n", "study.duration is -1; valid: a number above 0"),
    (HOSE + HOLD + "[study]\nerrors = [0.0]\n", "study.errors[0] is 0.0; valid: a number above"),
    (HOSE + HOLD + "[study]\nerrors = []\n", "study.errors is []; valid: a list of numbers"),
    (HOSE + HOLD + "[study]\nstart = 'as-laid'\n", "study.start is 'as-laid'; valid: left out"),
    (
        HOSE + HOLD + "[study]\nduration = 1\nstart = 'equilibrium'\n",
        "study.start is 'equilibrium'; valid: 'as-laid' where no hold moves",
    ),
    (HOSE + HOLD + "[flour]\nheight = 0\n", "flour is {'height': 0}; valid: a key among title"),
    ("title = 3\n" + HOSE + HOLD, "title is 3; valid: a text of one line"),
]


@pytest.mark.parametrize(("text", "what"), MISTAKES, ids=range(len(MISTAKES)))
def test_one_clear_error_for_each_mistake(read, text, what):
    with pytest.raises(InputError) as caught:
        read(text)
    message = str(caught.value)
    assert message.startswith("mine.toml: ")
    assert what in message
    assert "\n" not in message
    assert len(message) < 1000


@pytest.mark.parametrize(
    "data",
    [b"\xff\xfe", b"a = = 1", b"[" * 100_000, b"a = 1" + b"0" * 5000, b"a = 1\n" * 2],
)
def test_what_is_no_toml(read, data):
    with pytest.raises(InputError, match=r"^file is .*mine\.toml'; valid: TOML in UTF-8 \("):
        read(data)


def test_files_that_cannot_be_read(read, tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_hose_file(tmp_path / "none.toml")
    with pytest.raises(InputError, match="valid: a file to be read"):
        read_hose_file(tmp_path)
    with pytest.raises(InputError, match="at most 1000000 bytes"):
        read(b"#" * (LARGEST_FILE + 1))


FULL = tomllib.loads(
    "title = 'full'\nshape = [[0, 0, 1], [1, 0, 0], [1.5, 0, 1]]\n"
    + HOSE
    + "[[hose.fittings]]\nstart = 0\nend = 0.1\nlinear_density = 1\n"
    + HOLD
    + "spin = { turns = 2, duration = 1.0 }\n"
    + END
    + MOVE
    + "[loads]\ngravity = [0, 0, -1]\n[[loads.points]]\nat = 1\nforce = [1, 0, 0]\n"
    + "[floor]\nheight = 0\nfriction = 0.3\n[study]\nduration = 1\nerrors = [0.1]\n"
)
junk = st.one_of(
    st.integers(),
    st.floats(),
    st.booleans(),
    st.text("aé'\"\\{[=", max_size=5),
    st.lists(st.one_of(st.integers(-3, 3), st.floats()), max_size=4),
    st.dictionaries(st.sampled_from(["at", "length", "x"]), st.integers(), max_size=2),
)


def list_places(value, place=()):
    yield place
    keys = value if isinstance(value, dict) else range(len(value) if isinstance(value, list) else 0)
    for key in keys:
        yield from list_places(value[key], (*place, key))


def find(values, place):
    for key in place:
        values = values[key]
    return values


def to_toml(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f'"{key}" = {to_toml(v)}' for key, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(to_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


def complain(path):
    """What is wrong with a file, on one line; None where it is read. All else is a defect."""
    try:
        read_hose_file(path)
    except InputError as error:
        message = str(error)
    else:
        return None
    assert "\n" not in message
    return message


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_a_mangled_file_is_read_or_is_one_clear_error(tmp_path_factory, data):
    values = copy.deepcopy(FULL)
    for _ in range(data.draw(st.integers(1, 3))):
        places = [p for p in list_places(values) if p]
        place = data.draw(st.sampled_from(places))
        inside = find(values, place[:-1])
        what = data.draw(st.sampled_from(["replace", "drop", "rename"]))
        if what == "replace":
            inside[place[-1]] = data.draw(junk)
        elif what == "drop":
            del inside[place[-1]]
        elif isinstance(inside, dict):
            inside[data.draw(st.text("abcdefghij_", min_size=1))] = inside.pop(place[-1])
        if not values:
            break
    text = "\n".join(f'"{key}" = {to_toml(value)}' for key, value in values.items())
    path = tmp_path_factory.mktemp("mangled") / "mine.toml"
    path.write_text(text, encoding="utf-8")
    tomllib.loads(text)  # still TOML, so what is wrong is what it says
    message = complain(path)
    assert message is None or message.startswith("mine.toml: ")


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_a_broken_file_is_one_clear_error_at_most(tmp_path_factory, data):
    text = data.draw(st.sampled_from(EXAMPLES)).read_bytes()
    place = data.draw(st.integers(0, len(text)))
    broken = text[:place] + data.draw(st.binary(max_size=8)) + text[place + 3 :]
    path = tmp_path_factory.mktemp("broken") / "mine.toml"
    path.write_bytes(broken)
    complain(path)
