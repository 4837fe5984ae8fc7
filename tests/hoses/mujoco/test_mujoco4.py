"""What is left under MuJoCo 4, and what it brings: the reasons for the pin below 4, and its end.

`make smoke-mujoco4` runs this in a virtual environment of its own.
"""

import math

import mujoco
import numpy as np
import pytest

from hose_mj.hoses.registry import make_hose
from hose_mj.hoses.spec import HoseSpec

pytestmark = pytest.mark.mujoco4

SPEC = HoseSpec(
    length=1.0,
    axial_stiffness=2e4,
    bending_stiffness=0.2,
    torsional_stiffness=0.15,
    linear_density=0.1,
    damping_time=0.02,
)
ROD = """
<mujoco>
  <option integrator="discrete"/>
  <worldbody>
    <flexcomp name="rod" type="grid" dim="1" count="11 1 1" spacing="0.1 1 1" pos="0.5 0 0"
              mass="0.1" radius="0.01">
      <edge equality="true"/><elasticity young="1e6" poisson="0.3"/>
      <contact contype="0" conaffinity="0" selfcollide="none"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""


def test_this_is_mujoco_4():
    assert mujoco.__version__.split(".")[0] == "4"


def test_the_composite_cable_is_gone():
    with pytest.raises(ValueError, match=r"one of geds, flex, hinge-chain .*composite"):
        make_hose("cable", SPEC, timestep=1e-4)


def test_flex_and_geds_swing_alike():
    hoses = [
        make_hose("geds", SPEC, timestep=2e-3, control_points=16),
        make_hose("flex", SPEC, timestep=1e-3, segments=60, clamp_correction=True),
    ]
    tips = []
    for hose in hoses:
        hose.reset([[0, 0, 0], [1, 0, 0]])
        hose.clamp(0.0)
        path = []
        for _ in range(10):
            hose.step(round(0.05 / hose.timestep))
            path.append(hose.position([0.5, 1.0]).ravel())
        tips.append(np.array(path))
    assert np.ptp(tips[0][:, 5]) > 0.3
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-2)


def test_flex_and_geds_rest_alike():
    tips = []
    for model, options in (("geds", {}), ("flex", {"segments": 80, "clamp_correction": True})):
        hose = make_hose(model, SPEC, timestep=1e-3, **options)
        hose.reset([[0, 0, 0], [1, 0, 0]])
        hose.clamp(0.0)
        hose.attach(1.0, [0.8, 0.1, -0.1])
        hose.solve_static()
        tips.append(hose.position(np.linspace(0, 1, 6)))
    np.testing.assert_allclose(tips[1], tips[0], atol=2e-3)


def test_its_flexcomp_twists_and_keeps_turns():
    # A hinge for each edge, GJ / h between neighbours, as plain angles: a turn more is a turn more.
    model = mujoco.MjModel.from_xml_string(ROD)
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    assert len(hinges) == 10
    torsional_stiffness = 1e6 / 2.6 * math.pi * 0.01**4 / 2
    for angle in (0.3, 0.3 + 20 * math.pi):
        data = mujoco.MjData(model)
        data.qpos[model.jnt_qposadr[hinges]] = np.linspace(0.0, angle, 10)
        mujoco.mj_forward(model, data)
        torques = data.qfrc_passive[model.jnt_dofadr[hinges]]
        wanted = torsional_stiffness / 0.1 * angle / 9
        np.testing.assert_allclose(torques[[0, -1]], [wanted, -wanted], rtol=1e-9)
        np.testing.assert_allclose(torques[1:-1], 0.0, atol=1e-12)
