"""The scenes that ship with hose_mj: each is read, opens in plain MuJoCo, and steps."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from hose_mj.scenes.mjcf.scene import find_scene, list_scenes, read_scene

FLOORS = [f"floor_{n}" for n in range(1, 7)]
CELL = 0.05


def test_what_is_there():
    assert list_scenes() == ("corridor", "deck", *FLOORS, "lift")


@pytest.fixture(scope="module")
def scenes():
    return {name: read_scene(find_scene(name)) for name in list_scenes()}


@pytest.mark.parametrize("name", list_scenes())
def test_robots_in_order_and_as_compiled(scenes, name):
    scene = scenes[name]
    assert [r.name for r in scene.robots] == [f"robot{i}" for i in range(len(scene.robots))]
    model = scene.make_spec().compile()
    for place in (scene.source, scene.goal, *scene.robots):
        assert model.body(model.site(place.site).bodyid[0]).name == place.body
    assert model.nu >= 2 * len(scene.robots)


@pytest.mark.parametrize("name", list_scenes())
def test_opens_unchanged_from_any_folder_and_steps(scenes, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = scenes[name]
    model = mujoco.MjModel.from_xml_path(str(find_scene(name)))
    data = mujoco.MjData(model)
    for _ in range(100):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert np.isfinite(data.qvel).all()
    # Nothing overlaps at first: without hose or control a robot stays where it was put.
    for robot in scene.robots:
        assert np.linalg.norm(data.site(robot.site).xpos - robot.position) < 1e-3


@pytest.mark.parametrize("name", list_scenes())
def test_motors_move_each_robot(scenes, name):
    scene = scenes[name]
    model = scene.make_spec().compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.5 * model.actuator_ctrlrange[:, 1]
    for _ in range(100):
        mujoco.mj_step(model, data)
    for robot in scene.robots:
        assert np.linalg.norm(data.site(robot.site).xpos - robot.position) > 5e-3


@pytest.mark.parametrize("n", range(1, 7))
def test_the_floor_is_the_line_tasks(scenes, n):
    """21 x 21 cells of 5 cm, the source at the centre, a hose of 16 cells: the task of B.2."""
    scene = scenes[f"floor_{n}"]
    assert len(scene.robots) == n
    assert scene.spec.length == pytest.approx(16 * CELL)
    assert scene.cell_size == pytest.approx(CELL)
    low, high = scene.bounds
    assert [b - a for a, b in zip(low[:2], high[:2], strict=True)] == pytest.approx([1.05, 1.05])
    assert scene.source.position[:2] == (0.0, 0.0)
    cells = np.array([p.position[:2] for p in (*scene.robots, scene.source, scene.goal)]) / CELL
    assert cells == pytest.approx(np.round(cells))
    assert abs(cells).max() <= 10
    spans = np.linalg.norm(np.diff(cells[:-1], axis=0), axis=1)
    assert spans.max() <= 16 / n
    assert len({tuple(cell) for cell in np.round(cells)}) == n + 2


def test_four_pucks_stand_as_in_the_authors_experiment(scenes):
    cells = [tuple(round(x / CELL) for x in p.position[:2]) for p in scenes["floor_4"].robots]
    assert cells == [(2, 5), (2, 3), (3, 1), (1, 2)]
    assert tuple(round(x / CELL) for x in scenes["floor_4"].goal.position[:2]) == (-2, -2)


def test_a_puck_is_the_thesiss(scenes):
    model = scenes["floor_2"].make_spec().compile()
    for robot in scenes["floor_2"].robots:
        assert model.body(robot.body).mass[0] == pytest.approx(0.5)
        assert model.geom(f"{robot.name}/disc").size[0] == 0.02
        for axis in "xy":
            assert model.dof_damping[model.joint(f"{robot.name}/{axis}").dofadr[0]] == 5.0
            assert model.actuator(f"{robot.name}/drive_{axis}").ctrlrange == pytest.approx(
                [-20, 20]
            )


def test_equal_wheels_drive_a_base_forward_and_opposite_ones_turn_it(scenes):
    model = scenes["corridor"].make_spec().compile()
    for left, right in ((1.0, 1.0), (-1.0, 1.0)):
        data = mujoco.MjData(model)
        data.actuator("robot0/drive_left").ctrl[0] = left
        data.actuator("robot0/drive_right").ctrl[0] = right
        start = model.qpos0[model.joint("robot0/free").qposadr[0] :][:2]
        for _ in range(300):
            mujoco.mj_step(model, data)
        pose = data.joint("robot0/free").qpos
        forward, sideways = pose[:2] - start
        heading = 2 * np.arctan2(pose[6], pose[3])
        if left == right:
            assert forward > 0.05
            assert abs(sideways) < 0.01
            assert abs(heading) < 0.05
        else:
            assert heading > 0.2
            assert np.hypot(forward, sideways) < 0.05
