"""The models' entries: true capabilities, what is missing here, models of other packages."""

from __future__ import annotations

import inspect
import sys
from types import SimpleNamespace

import pytest

from hose_mj.errors import InputError
from hose_mj.hoses import registry
from hose_mj.hoses.mujoco.chain_settings import find_integrator
from hose_mj.hoses.registry import MODELS, find_model, list_models, make_hose
from hose_mj.hoses.spec import HoseSpec
from hose_mj.world.registry import make_world

SPEC = HoseSpec(length=1.0, axial_stiffness=2e4, bending_stiffness=0.05, linear_density=0.1)
SOURCE = """
from hose_mj.hoses.registry import ModelEntry

class Plain:
    "A hose that only knows its spec."
    def __init__(self, spec, *, timestep): self.spec, self.timestep = spec, timestep

ENTRY = ModelEntry(target="other_hoses:Plain", description="one more", twists=False)
LOST = ModelEntry(target="no_such_module:Hose", description="lost")
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Installs a package with hose models, as importlib.metadata sees it."""

    def install_models(**models):
        information = tmp_path / "other-1.0.dist-info"
        information.mkdir()
        (information / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
        lines = "\n".join(f"{name} = {target}" for name, target in models.items())
        (information / "entry_points.txt").write_text(f"[hose_mj.hoses]\n{lines}\n")
        (tmp_path / "other_hoses.py").write_text(SOURCE)
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "other_hoses", raising=False)

    return install_models


@pytest.mark.parametrize("model", MODELS)
def test_capabilities_are_those_of_the_class(model):
    entry = MODELS[model]
    options = inspect.signature(entry.load()).parameters
    assert {entry.resolution, entry.scheme, entry.plane} - {None} <= options.keys()
    assert entry.has_clamp_correction == ("clamp_correction" in options)
    assert entry.contact == ("obstacles" in options or entry.contact_law)
    assert entry.schemes


def test_models_of_other_packages_are_made_by_name(install):
    install(entry="other_hoses:ENTRY", plain="other_hoses:Plain")
    assert list(list_models()) == [*MODELS, "entry", "plain"]
    assert find_model("plain").description == "A hose that only knows its spec."
    assert not find_model("entry").twists
    for model in ("entry", "plain"):
        assert make_hose(model, SPEC, timestep=0.1).spec is SPEC
    with pytest.raises(InputError, match=r"options of plain is .*; valid: with 'timestep'"):
        make_hose("plain", SPEC)
    with pytest.raises(InputError, match=r"'no-such'; valid: one of geds, .*, entry, plain"):
        find_model("no-such")


def test_our_own_names_win(install):
    install(geds="other_hoses:Plain")
    assert find_model("geds") is MODELS["geds"]
    with pytest.raises(InputError, match=r"'geds' in hose_mj.hoses of package other"):
        list_models()


def test_a_broken_model_of_another_package_is_one_clear_error(install):
    install(number="other_hoses:__name__", lost="other_hoses:LOST", typo="other_hoses:Plian")
    for model, message in (
        ("number", "package other is 'other_hoses'; valid: a ModelEntry or a type"),
        ("typo", "package other is 'other_hoses:Plian'; valid: importable"),
        ("lost", "class of a hose model is 'no_such_module:Hose'; valid: importable"),
    ):
        with pytest.raises(InputError, match=message):
            make_hose(model, SPEC, timestep=0.1)


def test_under_mujoco_4_the_cable_says_what_is_left(monkeypatch):
    monkeypatch.setattr(registry, "version", lambda package: "4.0.1")
    message = r"'cable'; valid: one of geds, flex, hinge-chain \(mujoco 4\.0\.1 has no composite"
    with pytest.raises(InputError, match=message):
        make_hose("cable", SPEC, timestep=1e-3)
    with pytest.raises(InputError, match=message):
        make_world("no scene is read", "cable")


@pytest.mark.parametrize("old", ["3.11.0", "3.12.1"])
def test_before_mujoco_3_13_the_flex_says_what_it_lacks(monkeypatch, old):
    monkeypatch.setattr(registry, "version", lambda package: old)
    with pytest.raises(InputError) as caught:
        registry.check_model("flex")
    assert str(caught.value) == (
        "model is 'flex'; valid: one of geds, cable, hinge-chain "
        f'(mujoco {old} has no integrator "discrete"; it needs mujoco 3.13 or later)'
    )


def test_an_integrator_that_this_mujoco_lacks(monkeypatch):
    mujoco = pytest.importorskip("mujoco")
    older = SimpleNamespace(mjINT_EULER=0, mjINT_RK4=1)
    monkeypatch.setattr(mujoco, "mjtIntegrator", older)
    with pytest.raises(InputError, match=r"integrator is 'discrete'; valid: one of euler, rk4 \("):
        find_integrator("discrete")


def test_without_mujoco_geds_is_left(monkeypatch):
    def find_version(package):
        raise registry.PackageNotFoundError(package)

    monkeypatch.setattr(registry, "version", find_version)
    with pytest.raises(InputError, match=r"valid: one of geds \(it needs mujoco: pip install"):
        make_hose("flex", SPEC, timestep=1e-3)
