"""Scenes that tests write, and worlds of them."""

import pytest

from hose_mj import HoseSpec, make_hose
from hose_mj.scenes.mjcf.scene import read_scene

HOSE = {"length": 1.0, "outer_radius": 0.01, "axial_stiffness": 1e4, "bending_stiffness": 0.02}
HOSE |= {"linear_density": 0.1}


def write_numerics(hose):
    return "".join(f'<numeric name="hose_{name}" data="{value}"/>' for name, value in hose.items())


@pytest.fixture
def write_scene(tmp_path):
    """Writes a scene from the robots' bodies and what else is in the world, and reads it.

    `write_scene.slider` and `write_scene.ball` write robots.
    """

    def write(robots, rest="", gravity="0 0 0", timestep=0.005, top="", **hose):
        path = tmp_path / "scene.xml"
        path.write_text(
            f'<mujoco><option timestep="{timestep}" gravity="{gravity}" integrator="implicitfast"/>'
            f"<custom>{write_numerics(HOSE | hose)}</custom>{top}<worldbody>{rest}"
            '<site name="hose_source" pos="0 0 0"/><site name="goal" pos="0.5 0 0"/>'
            f"{''.join(robots)}</worldbody></mujoco>"
        )
        return read_scene(path)

    write.slider, write.ball = make_slider, make_ball
    return write


def make_slider(number, place, mass, axes="xyz", damping=0.0, size=0.02, solid=True):
    """A ball on slides along some axes of the world, held at its middle."""
    directions = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    joints = "".join(
        f'<joint type="slide" axis="{directions[axis]}" damping="{damping}"/>' for axis in axes
    )
    bits = "" if solid else 'contype="0" conaffinity="0"'
    return (
        f'<body name="r{number}" pos="{" ".join(map(str, place))}">{joints}'
        f'<geom type="sphere" size="{size}" mass="{mass}" {bits}/>'
        f'<site name="r{number}/hose_attach"/></body>'
    )


def make_ball(number, place, mass, size=0.02):
    """A ball that moves and turns freely, held at its middle; it touches nothing."""
    return (
        f'<body name="r{number}" pos="{" ".join(map(str, place))}"><freejoint/>'
        f'<geom type="sphere" size="{size}" mass="{mass}" contype="0" conaffinity="0"/>'
        f'<site name="r{number}/hose_attach"/></body>'
    )


@pytest.fixture
def make_hose_of():
    """A hose of 1 m without gravity."""

    def make(timestep=0.005, scheme="bdf2", **changes):
        spec = HoseSpec(**(HOSE | {"torsional_stiffness": 0.0} | changes))
        return make_hose(
            "geds", spec, timestep=timestep, scheme=scheme, gravity=(0, 0, 0), tolerance=1e-6
        )

    return make
