"""Where the shipped files are found: beside the package in a checkout, inside it in a wheel."""

from __future__ import annotations

from pathlib import Path

import pytest

from hose_mj.assets import find_asset, find_assets
from hose_mj.errors import InputError

ROOT = Path(__file__).resolve().parent.parent


def test_in_this_checkout():
    assert find_assets() == ROOT / "assets"
    assert find_asset("materials.toml") == ROOT / "assets" / "materials.toml"


def test_a_wheel_has_them_inside_the_package(tmp_path):
    inside, beside = tmp_path / "hose_mj" / "assets", tmp_path / "assets"
    beside.mkdir()
    assert find_assets(tmp_path / "hose_mj") == beside
    inside.mkdir(parents=True)
    assert find_assets(tmp_path / "hose_mj") == inside


def test_without_assets(tmp_path):
    with pytest.raises(InputError, match="folder of the assets is None; valid: "):
        find_assets(tmp_path / "hose_mj")


@pytest.mark.parametrize("name", ["nothing.toml", "../pyproject.toml", "hoses", ""])
def test_what_is_no_asset(name):
    with pytest.raises(InputError, match=r"asset is .*; valid: .*materials\.toml"):
        find_asset(name)
