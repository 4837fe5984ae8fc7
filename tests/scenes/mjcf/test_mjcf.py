"""A user's scene in MJCF: what it means, one clear error for each mistake, and hostile files."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hose_mj.errors import InputError
from hose_mj.hoses.spec import HoseSpec
from hose_mj.scenes.mjcf import files as mjcf_files
from hose_mj.scenes.mjcf import model as mjcf_model
from hose_mj.scenes.mjcf.files import DEEPEST, LARGEST_XML, MOST_ELEMENTS, MOST_NAMED, read_files
from hose_mj.scenes.mjcf.scene import HOSE_NUMERICS, find_scene, read_scene

ROOT = Path(__file__).resolve().parents[3]
HOSE = """
    <numeric name="hose_length" data="2"/>
    <numeric name="hose_outer_radius" data="0.01"/>
    <numeric name="hose_axial_stiffness" data="5e3"/>
    <numeric name="hose_bending_stiffness" data="5e-3"/>
    <numeric name="hose_linear_density" data="0.15"/>
"""


def make_robot(prefix, x, body="", inside=""):
    return f"""
    <body name="{body or prefix + "body"}" pos="{x} 0 0">
      <joint name="{prefix}x" type="slide" axis="1 0 0"/>
      <geom size="0.05" mass="1"/>
      <site name="{prefix}hose_attach"/>{inside}
    </body>"""


def make_order(*sites):
    elements = "".join(f'<element objtype="site" objname="{site}"/>' for site in sites)
    return f'<tuple name="hose_robots">{elements}</tuple>'


SITES = '<site name="hose_source"/><site name="goal" pos="1 1 0"/>'
ROBOTS = make_robot("r0/", 1.8) + make_robot("r1/", 0.9)


def make_scene(hose=HOSE, sites=SITES, robots=ROBOTS, head="", custom=""):
    return f"""<mujoco>{head}
  <custom>{hose}{custom}</custom>
  <worldbody>{sites}{robots}</worldbody>
</mujoco>"""


SCENE = make_scene()


@pytest.fixture
def write(tmp_path):
    """Writes a text or bytes as "mine.xml" and returns its path."""

    def write_text(text, name="mine.xml"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write_text


def test_a_scene_is_read(write):
    scene = read_scene(write(SCENE))
    assert [r.name for r in scene.robots] == ["r0", "r1"]
    assert [r.site for r in scene.robots] == ["r0/hose_attach", "r1/hose_attach"]
    assert [r.body for r in scene.robots] == ["r0/body", "r1/body"]
    assert [r.arc_length for r in scene.robots] == [2.0, 1.0]
    assert scene.robots[1].position == (0.9, 0.0, 0.0)
    assert scene.goal.position == (1.0, 1.0, 0.0)
    assert scene.spec == HoseSpec(
        length=2.0,
        axial_stiffness=5e3,
        bending_stiffness=5e-3,
        torsional_stiffness=5e-3 / 1.3,
        linear_density=0.15,
        outer_radius=0.01,
    )
    assert (scene.friction, scene.timestep) == (0.3, 0.002)
    assert scene.bounds == ((-math.inf,) * 3, (math.inf,) * 3)
    assert scene.cell_size == 2.0 / 16
    assert scene.make_spec().compile().nu == 0


def test_a_section_and_a_material_make_the_hose(write):
    hose = """<numeric name="hose_length" data="2"/><text name="hose_material" data="steel"/>
      <numeric name="hose_outer_radius" data="0.01"/>
      <numeric name="hose_inner_radius" data="0.005"/>"""
    tube = HoseSpec.from_material(
        length=2.0,
        youngs_modulus=210e9,
        poisson_ratio=0.3,
        density=7850.0,
        outer_radius=0.01,
        inner_radius=0.005,
    )
    assert read_scene(write(make_scene(hose))).spec == tube
    softer = hose + '<numeric name="hose_youngs_modulus" data="210e6"/>'
    soft = read_scene(write(make_scene(softer))).spec
    assert soft.axial_stiffness == pytest.approx(1e-3 * tube.axial_stiffness)
    ready = hose.replace("steel", "usb-cable") + '<numeric name="hose_drag" data="0.1"/>'
    cable = read_scene(write(make_scene(ready.split("<numeric name='hose_outer_radius'")[0]))).spec
    assert (cable.bending_stiffness, cable.drag) == (2.64e-4, 0.1)


def test_prefixes_bounds_friction_and_attachments(write):
    custom = """<numeric name="bounds" data="-3 -2 3 2"/><numeric name="hose_friction" data="0.6"/>
      <numeric name="hose_attachments" data="1.9 0.95"/><numeric name="cell_size" data="0.2"/>"""
    text = make_scene(custom=custom, sites=SITES.replace("goal", "arena/goal"))
    scene = read_scene(write(text.replace('"hose_source', '"arena/hose_source')))
    assert (scene.goal.site, scene.source.site) == ("arena/goal", "arena/hose_source")
    assert scene.bounds == ((-3.0, -2.0, -math.inf), (3.0, 2.0, math.inf))
    assert (scene.friction, scene.cell_size) == (0.6, 0.2)
    assert [r.arc_length for r in scene.robots] == [1.9, 0.95]
    space = custom.replace("-3 -2 3 2", "-3 -2 0 3 2 1")
    assert read_scene(write(make_scene(custom=space))).bounds == ((-3, -2, 0), (3, 2, 1))


def test_robots_are_numbered_from_the_tip_by_their_names(write):
    shuffled = make_robot("arm2_1_", 0.9) + make_robot("arm2_2_", 0.5) + make_robot("arm2_0_", 1.5)
    scene = read_scene(write(make_scene(robots=shuffled)))
    assert [r.name for r in scene.robots] == ["arm2_0", "arm2_1", "arm2_2"]
    assert [r.arc_length for r in scene.robots] == pytest.approx([2.0, 4 / 3, 2 / 3])


def test_a_tuple_numbers_robots_whose_names_do_not(write):
    robots = make_robot("near/", 0.5) + make_robot("far/", 1.5)
    order = make_order("far/hose_attach", "near/hose_attach")
    scene = read_scene(write(make_scene(robots=robots, custom=order)))
    assert [r.name for r in scene.robots] == ["far", "near"]


def test_a_single_robot_needs_neither_prefix_nor_number(write):
    scene = read_scene(write(make_scene(robots=make_robot("", 0.5, body="tug"))))
    assert [(r.name, r.arc_length) for r in scene.robots] == [("tug", 2.0)]


def test_the_start_is_the_keyframe_of_that_name(write):
    head = '<keyframe><key name="start" qpos="-0.1 0.05"/></keyframe>'
    scene = read_scene(write(make_scene(head=head)))
    assert [r.position[0] for r in scene.robots] == pytest.approx([1.7, 0.95])


def test_the_example_of_the_documentation(write):
    text = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    example = text.split("```xml\n")[1].split("```")[0]
    scene = read_scene(write(example))
    assert [r.name for r in scene.robots] == ["robot0", "robot1"]
    assert scene.make_spec().compile().nu == 4


def test_the_documentation_names_every_numeric():
    text = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    assert not [name for name in HOSE_NUMERICS if f"`{name}`" not in text]


def test_the_longest_spans_are_allowed(write):
    taut = make_robot("r0/", 2.0) + make_robot("r1/", 1.0)
    assert len(read_scene(write(make_scene(robots=taut))).robots) == 2


def number(name, data):
    """A hose whose numeric has other data."""
    return f'<numeric name="{name}" data="{data}"/>'


def replace_hose(old, new):
    return make_scene(HOSE.replace(old, new))


TWICE = make_robot("r0/", 1.8, inside='<site name="r1/hose_attach"/>')
MISTAKES = [
    (make_scene(sites='<site name="goal"/>'), "sites hose_source is []; valid: one <site name="),
    (make_scene(sites='<site name="hose_source"/>'), "sites goal is []; valid: one"),
    (make_scene(sites=SITES + '<site name="a/goal"/>'), "sites goal is ['goal', 'a/goal']; valid"),
    (make_scene(sites=SITES + '<site name="b_hose_source"/>'), "sites hose_source is ['hose_sou"),
    (make_scene(robots=""), "sites hose_attach is None; valid: one in each robot's body"),
    (make_scene(robots=TWICE), "site r1/hose_attach is 'r0/body'; valid: one in a body; r0/"),
    (
        make_scene(sites=SITES + '<site name="r2/hose_attach"/>'),
        "site r2/hose_attach is 'world'; valid: in a body that joints let move",
    ),
    (
        make_scene(sites='<site name="goal"/>', robots=make_robot("", 1, inside=SITES[:26])),
        "site hose_source is 'body'; valid: in a body that cannot move",
    ),
    (SCENE.replace("r1/", "r2/"), "number of the robot with site r2/hose_attach is 2; valid: each"),
    (SCENE.replace("r1/", "b/"), "number of the robot with site b/hose_attach is None; valid: ea"),
    (
        make_scene(robots=make_robot("a0/", 0.1) + make_robot("b0/", 0.2)),
        "number of the robot with site b0/hose_attach is 0; valid: each of 0 (tip) to 1",
    ),
    (
        make_scene(custom=make_order("goal")),
        "tuple hose_robots is ['goal']; valid: each of the sites r0/hose_attach, r1/",
    ),
    (
        SCENE.replace('pos="1.8', 'pos="2.1'),
        "distance of site r0/hose_attach is 2.1; valid: at most 2 m from the source, the hose up",
    ),
    (
        SCENE.replace('pos="0.9', 'pos="0.7'),
        "distance of site r0/hose_attach is 1.1; valid: at most 1 m from r1/hose_attach, the hose",
    ),
    (
        SCENE.replace('pos="1 1 0"', 'pos="2 2 0"'),
        "distance of site goal is 2.828427; valid: at most 2 m from the source, the whole hose",
    ),
    (make_scene(custom=number("hose_friction", -1)), "numeric hose_friction is -1.0; valid: one"),
    (
        make_scene(custom=number("hose_friction", "nan")),
        "data (line 8) is 'nan'; valid: f",
    ),
    (make_scene(custom=number("bounds", "1 2 3")), "numeric bounds is (1.0, 2.0, 3.0); valid: x"),
    (make_scene(custom=number("bounds", "1 1 0 2")), "numeric bounds is (1.0, 1.0, 0.0, 2.0)"),
    (
        make_scene(custom=number("bounds", "-1 -1 1 1")),
        "position of site r0/hose_attach is (1.8, 0.0, 0.0); valid: within the bounds, (-1.0, ",
    ),
    (make_scene(custom=number("cell_size", 0)), "numeric cell_size is (0.0,); valid: one number"),
    (make_scene(custom=number("cell_size", 2.1)), "cell_size is (2.1,); valid: one number above 0"),
    (make_scene(custom=number("cell_size", "1 1")), "numeric cell_size is (1.0, 1.0); valid: one"),
    (make_scene(custom=number("hose_attachments", "1 2")), "numeric hose_attachments is (1.0, 2."),
    (make_scene(custom=number("hose_attachments", "1")), "hose_attachments is (1.0,); valid: 2 nu"),
    (make_scene(custom=number("hose_lenght", 1)), "numeric is 'hose_lenght'; valid: one of hose_l"),
    (make_scene(custom='<text name="hose_stuff" data="a"/>'), "text is 'hose_stuff'; valid: one"),
    (
        make_scene(custom='<text name="hose_material" data="noodle"/>'),
        "text hose_material is 'noodle'; valid: one of garden-hose-19mm",
    ),
    (replace_hose('data="2"', 'data="-2"'), "numeric hose_length is -2.0; valid: a number from"),
    (replace_hose('data="2"', 'data="1 2"'), "numeric hose_length is (1.0, 2.0); valid: one num"),
    (
        replace_hose('data="0.01"', 'data="1"'),
        "numeric hose_outer_radius is 1.0; valid: at most 0.25 ",
    ),
    (replace_hose('data="0.15"', 'data="0"'), "numeric hose_linear_density is 0.0; valid: a finit"),
    (replace_hose('data="5e3"', 'data="-1"'), "numeric hose_axial_stiffness is -1.0; valid: a f"),
    (make_scene(custom=number("hose_inner_radius", 0.01)), "hose_inner_radius is 0.01; valid: bel"),
    (make_scene("<numeric name='hose_length' data='2'/>"), "numeric hose_axial_stiffness is None"),
    (make_scene(""), "numeric hose_length is None; valid: <custom><numeric name='hose_length'"),
    (make_scene(head='<option timestep="nan"/>'), "<option> timestep (line 1) is 'nan'; valid: f"),
    (make_scene(head='<option timestep="-1"/>'), "<option> timestep is -1.0; valid: a finite num"),
    (make_scene(head='<option timestep="0"/>'), "<option> timestep is 0.0; valid: a finite numbe"),
    (make_scene(head='<option gravity="0 inf 0"/>'), "<option> gravity (line 1) is '0 inf 0'; v"),
    (
        SCENE.replace('mass="1"', 'mass="nan"', 1),
        "<geom> mass (line 12) is 'nan'; valid: finite",
    ),
    (SCENE.replace('mass="1"', 'mass="-1"', 1), "valid: MJCF that MuJoCo 3."),
    (SCENE.replace('size="0.05"', 'size="1e200"', 1), "body r0/body: inertia is inf; valid: a fi"),
    (SCENE.replace('mass="1"', 'mass="0"', 1), "mass and inertia of moving bodies must be larger"),
    (
        SCENE.replace('type="slide"', 'type="slide" stiffness="-2"', 1),
        "joint r0/x: stiffness is -2.0; valid: a finite number at or above 0",
    ),
    (
        SCENE.replace('type="slide"', 'type="slide" damping="-2"', 1),
        "joint r0/x: damping is -2.0; valid: a finite number at or above 0",
    ),
    (
        make_scene(robots=ROBOTS + '<replicate count="2100"><body/></replicate>'),
        "nbody is 2103; valid: at most 2000",
    ),
    (
        SCENE.replace("<worldbody>", '<worldbody><geom type="mesh" mesh="none"/>'),
        "file is 'mine.xml'; valid: MJCF that MuJoCo 3.",
    ),
]


@pytest.mark.parametrize(("text", "what"), MISTAKES, ids=range(len(MISTAKES)))
def test_one_clear_error_for_each_mistake(write, text, what):
    message = complain(write(text))
    assert message is not None
    assert message.startswith("mine.xml: ") or message.startswith("file is 'mine.xml'")
    assert what in message


def complain(path):
    """What is wrong with a scene, on one line; None where it is read. All else is a defect."""
    try:
        read_scene(path)
    except InputError as error:
        message = str(error)
    else:
        return None
    assert "\n" not in message
    assert len(message) < 2000
    return message


def make_mesh(attributes):
    return f"<mujoco><asset><mesh name='m' {attributes}/></asset></mujoco>"


DEEP = "<worldbody>" + "<body>" * DEEPEST + "</body>" * DEEPEST + "</worldbody>"
BOMB = '<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]><mujoco model="&c;"/>'
HOSTILE = [
    (make_mesh('file="/etc/passwd"'), "<mesh m> file (line 1) is '/etc/passwd'; valid: a path b"),
    (make_mesh('file="../a.obj"'), "<mesh m> file (line 1) is '../a.obj'; valid: a path below"),
    (make_mesh('file="a/../../b.obj"'), "<mesh m> file (line 1) is 'a/../../b.obj'; valid"),
    (make_mesh('file="..\\a.obj"'), "valid: a path below the scene's folder"),
    (make_mesh('file="http://a.b/c.obj"'), "valid: a path below the scene's folder"),
    (make_mesh('file="&#x2e;&#x2e;/a.obj"'), "<mesh m> file (line 1) is '../a.obj'; valid"),
    (make_mesh('file="none.obj"'), "mesh m> file is 'none.obj'; valid: a file in the scene's fo"),
    ("<mujoco><compiler meshdir='/tmp'/></mujoco>", "<compiler> meshdir (line 1) is '/tmp'; val"),
    ("<mujoco><include file='../a.xml'/></mujoco>", "<include> file (line 1) is '../a.xml'; val"),
    ("<mujoco><include file='mine.xml'/></mujoco>", "file is 'mine.xml'; valid: MJCF that MuJoCo"),
    ("<mujoco><include file='none.xml'/></mujoco>", "<include> file is 'none.xml'; valid: a file"),
    (f"<mujoco>{DEEP}</mujoco>", f"depth of elements (line 1) is '{DEEPEST + 1}'; valid: at most"),
    (
        "<mujoco>" + "<size/>" * MOST_ELEMENTS + "</mujoco>",
        f"number of elements (line 1) is '{MOST_ELEMENTS + 1}'; valid: at most {MOST_ELEMENTS}",
    ),
    (
        "<mujoco>" + "<compiler meshdir='%d'/>" * 9 % tuple(range(9)) + "</mujoco>",
        "<compiler> meshdir (line 1) is '7'; valid: at most 8 folders of assets",
    ),
    (
        "<mujoco>" + "<model file='a'/>" * (MOST_NAMED + 1) + "</mujoco>",
        f"<model> file (line 1) is 'a'; valid: at most {MOST_NAMED} elements that name files",
    ),
    (BOMB, "<!DOCTYPE> (line 1) is 'a'; valid: XML without document type and entities"),
    (b"<mujoco>" + b" " * LARGEST_XML + b"</mujoco>", f"a file of at most {LARGEST_XML} bytes"),
    ("<robot name='a'/>", "first element (line 1) is 'robot'; valid: mujoco (MJCF)"),
    ("<mujoco>", "valid: MJCF, which is well-formed XML in UTF-8 (no element found"),
    (SCENE.encode("utf-16"), "valid: MJCF, which is well-formed XML in UTF-8 ("),
    (b"", "valid: MJCF, which is well-formed XML in UTF-8 (no element found"),
    (b"\0" * 100, "valid: MJCF, which is well-formed XML in UTF-8 ("),
]


@pytest.mark.parametrize(("text", "what"), HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_files_are_refused(write, text, what):
    message = complain(write(text))
    assert message is not None
    assert what in message


def test_links_out_of_the_folder_are_refused(write, tmp_path):
    outside = write("<mujoco/>", "elsewhere/a.xml")
    path = write("<mujoco><include file='a.xml'/></mujoco>", "scene/mine.xml")
    (path.parent / "a.xml").symlink_to(outside)
    assert "valid: a file in the scene's folder, not a link" in complain(path)
    (path.parent / "a.xml").unlink()
    (path.parent / "sub").symlink_to(outside.parent)
    path.write_text("<mujoco><include file='sub/a.xml'/></mujoco>")
    assert "valid: a file in the scene's folder, not a link" in complain(path)


TETRAHEDRON = """v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1
f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"""


def test_meshes_are_found_in_folders_that_an_include_names(write):
    write(TETRAHEDRON, "meshes/a.obj")
    write("<mujoco><compiler meshdir='meshes'/></mujoco>", "parts/c.xml")
    head = "<include file='parts/c.xml'/><asset><mesh name='m' file='a.obj'/></asset>"
    mesh = '<geom type="mesh" mesh="m" pos="0 0 5"/>'
    path = write(make_scene(sites=SITES + mesh, head=head))
    scene = read_scene(path)
    assert scene.make_spec().compile().nmesh == 1
    write(TETRAHEDRON.replace("v 1 0 0", "v 2 0 0"), "meshes/a.obj")
    assert read_files(path).digest != scene.digest


def test_an_oversize_asset_is_refused(write, monkeypatch):
    monkeypatch.setattr(mjcf_files, "LARGEST_ASSET", 50)
    write(TETRAHEDRON, "a.obj")
    message = complain(write(make_mesh("file='a.obj'")))
    assert message == "mine.xml: <mesh m> file is 'a.obj'; valid: a file of at most 50 bytes"


def test_an_include_is_read_with_the_same_rules(write):
    write("<mujoco><asset><mesh name='m' file='/etc/passwd'/></asset></mujoco>", "parts/a.xml")
    path = write("<mujoco><include file='parts/a.xml'/></mujoco>")
    assert complain(path).startswith("a.xml: <mesh m> file (line 1) is '/etc/passwd'")


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="valid: a file to be read"):
        read_scene(tmp_path / "none.xml")
    with pytest.raises(InputError, match="valid: a file to be read"):
        read_scene(tmp_path)
    with pytest.raises(InputError, match=r"scene is 'none'; valid: an MJCF file, or one of corr"):
        find_scene("none")


def test_a_scene_that_changed_is_not_compiled(write):
    path = write(SCENE)
    scene = read_scene(path)
    write(SCENE.replace('mass="1"', 'mass="2"'))
    with pytest.raises(InputError, match="valid: files unchanged since the scene was read"):
        scene.make_spec()
    write(SCENE)
    assert read_scene(path) == scene


def test_the_digest_covers_every_file(write):
    write("<mujoco/>", "part.xml")
    path = write("<mujoco><include file='part.xml'/></mujoco>")
    before = read_files(path).digest
    write("<mujoco />", "part.xml")
    assert read_files(path).digest != before


def test_a_scene_that_would_take_all_memory_is_refused(write):
    head = (
        "<asset><texture name='t' type='2d' builtin='flat' width='60000' height='60000'/></asset>"
    )
    assert complain(write(make_scene(head=head))).startswith("file is 'mine.xml'; valid: ")


def test_a_crash_and_a_hang_become_errors(write, monkeypatch, tmp_path):
    path = write(SCENE)
    package = tmp_path / "fake"
    package.mkdir()
    crash = package / "crash_probe.py"
    crash.write_text("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    (package / "hang_probe.py").write_text("import time; time.sleep(60)")
    monkeypatch.setenv("PYTHONPATH", str(package))
    monkeypatch.setattr(mjcf_model, "LONGEST", 0.5)
    for module, what in (("crash_probe", "status -11"), ("hang_probe", "it took longer")):
        monkeypatch.setattr(mjcf_model.__spec__, "name", module)
        assert what in complain(path)


# Most numbers replaced leave the file well formed, so that it reaches MuJoCo.
mutation = st.tuples(
    st.sampled_from(["number", "number", "number", "digit", "flip", "cut", "double", "insert"]),
    st.floats(0, 1),
    st.integers(1, 40),
    st.one_of(
        st.binary(min_size=1, max_size=8),
        st.sampled_from([b"nan", b"-1", b"1e308", b"inf", b"<body/>", b"'", b'"', b">", b"&lt;"]),
    ),
)


NUMBERS = (b"-1", b"0", b"7", b"1e308", b"-1e-300", b"1e10", b"1e5", b"0.3", b"1 2", b"3 x", b"")


def mutate(data, changes):
    for kind, where, size, junk in changes:
        k = int(where * len(data))
        if kind in ("number", "digit"):
            digits = [i for i, c in enumerate(data) if chr(c).isdigit()]
            k = digits[int(where * (len(digits) - 1))] if digits else k
            what = junk if kind == "digit" else NUMBERS[size % len(NUMBERS)]
            data = data[:k] + what + data[k + 1 :]
        elif kind == "flip":
            data = data[:k] + junk + data[k + len(junk) :]
        elif kind == "cut":
            data = data[:k] + data[k + size :]
        elif kind == "double":
            data = data[:k] + data[k : k + size] + data[k:]
        else:
            data = data[:k] + junk + data[k:]
    return data


def check_mutated(folder, changes):
    path = folder / "mine.xml"
    path.write_bytes(mutate(SCENE.encode(), changes))
    message = complain(path)
    assert message is None or "valid: " in message


FEW, MANY = 25, 1000


@settings(max_examples=FEW, deadline=None, derandomize=True, database=None)
@given(changes=st.lists(mutation, min_size=1, max_size=3))
def test_a_mangled_scene_is_read_or_is_one_clear_error(tmp_path_factory, changes):
    check_mutated(tmp_path_factory.mktemp("mangled"), changes)


@pytest.mark.slow
@settings(max_examples=MANY, deadline=None)
@given(changes=st.lists(mutation, min_size=1, max_size=3))
def test_many_mangled_scenes(tmp_path_factory, changes):
    check_mutated(tmp_path_factory.mktemp("mangled"), changes)
