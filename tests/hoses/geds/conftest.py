import numpy as np
import pytest

from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import HoseSpec

EI, DENSITY = 0.05, 0.1


@pytest.fixture
def make_hose():
    """Makes a hose of 1 m, 0.1 kg/m, EI 0.05 N m^2; a number for `ea` in units of EI / L^2."""

    def make(*, ea=4e5, ei=EI, damping=0.0, drag=0.0, length=1.0, curvature=0.0, **options):
        spec = HoseSpec(
            length=length,
            axial_stiffness=ea * ei / length**2,
            bending_stiffness=ei,
            torsional_stiffness=0.0,
            linear_density=DENSITY,
            rest_curvature=curvature,
            damping_time=damping,
            drag=drag,
        )
        return GedsHose(spec, **options)

    return make


@pytest.fixture
def wave():
    """A smooth curve of about 1 m in the xz-plane."""

    def curve(s):
        return np.stack([s, 0.0 * s, 0.05 * np.sin(np.pi * s)], axis=1)

    return curve
