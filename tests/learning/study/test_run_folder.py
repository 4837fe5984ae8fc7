"""Learners on disk: what is read is what was written, or one clear error."""

import dataclasses
import hashlib
import json

import numpy as np
import pytest
from hose_learning.learners import catalog
from hose_learning.modules import Module
from hose_learning.settings import Exploration, LearnerSettings
from hose_learning.study import run_folder
from hose_learning.study.run_folder import CHECKPOINT, CONFIG, RunFolder
from hose_learning.study.training import Training

from hose_mj.errors import InputError
from hose_mj.tasks.registry import make_task

SETTINGS = LearnerSettings(
    modules=(
        Module(name="goal", variables=("p_0", "p_1"), signals=("goal",)),
        Module(
            name="walls",
            kind="veto",
            variables=("p_0",),
            events=("collision",),
            credit="own",
            actions=("left", "right"),
        ),
        Module(name="risk", variables=(), signals=("collision",), threshold=-3.5),
    ),
    discount=0.8,
    learning_rate=0.1,
    learning_rate_decay=0.01,
    exploration=Exploration(
        epsilon=0.7, least=0.1, per_episode=0.01, per_success=0.02, policy="soft-max"
    ),
    mediator="best-happiness",
    share_vetoes=True,
    fallback="any",
    hashed=False,
    options={},
)


def make(id="d-rr-ql", seed=3, settings=SETTINGS, **options):
    task = make_task("corridor", **options)
    return Training(task, id, settings, np.random.default_rng(seed), compiled=False)


def pass_through_json(description):
    return json.loads(json.dumps(description))


@pytest.mark.parametrize(
    ("id", "options"),
    [
        ("line", {"n_robots": 2, "start": ((0, 2), (0, 1)), "goal": (1, 1)}),
        ("line-2015", {}),
        ("taxi", {}),
    ],
)
def test_a_description_makes_the_same_training(check_same, id, options):
    task = make_task(id, **options)
    settings = catalog.make_settings("d-rr-ql", task)
    training = Training(task, "d-rr-ql", settings, np.random.default_rng(5))
    description = run_folder.describe(training, 5)
    again = run_folder.remake(pass_through_json(description))
    assert again.settings == training.settings
    assert again.task.settings == task.settings
    assert again.task.id == id
    assert tuple(description) == run_folder.DESCRIPTION
    check_same(training, again)


def test_all_settings_pass_through_json():
    plain = pass_through_json(dataclasses.asdict(SETTINGS))
    assert run_folder.read_settings(plain) == SETTINGS
    traces = dataclasses.replace(SETTINGS, options={"trace_decay": 0.5, "n_kept": 3})
    assert run_folder.read_settings(pass_through_json(dataclasses.asdict(traces))) == traces


CHANGES = [
    {"discount": 0.81},
    {"learning_rate": 0.2},
    {"learning_rate_decay": 0.0},
    {"mediator": "greatest-mass"},
    {"share_vetoes": False},
    {"fallback": "none"},
    {"hashed": True},
    {"options": {"x": 1.0}},
    {"modules": SETTINGS.modules[:2]},
    *({"modules": (dataclasses.replace(SETTINGS.modules[1], **change), *SETTINGS.modules[::2])}
      for change in ({}, {"credit": "cycle"}, {"events": ()}, {"actions": ()}, {"name": "w"})),
    *({"exploration": dataclasses.replace(SETTINGS.exploration, **change)}
      for change in (
          {"epsilon": 0.6}, {"least": 0.0}, {"per_episode": 0.0}, {"per_success": 0.0},
          {"policy": "epsilon-greedy"}, {"temperature_factor": 2.0},
      )),
]  # fmt: skip


def test_an_identity_changes_with_any_setting():
    training = make()
    base = run_folder.describe(training, 3)
    identities = {run_folder.compute_identity(base)}
    assert identities == {run_folder.compute_identity(pass_through_json(base))}
    assert identities == {run_folder.compute_identity(dict(reversed(base.items())))}
    others = [run_folder.describe(make(step_limit=99), 3), run_folder.describe(training, 4)]
    others.append({**base, "learner": "safe-msav"})
    for change in CHANGES:
        changed = dataclasses.asdict(dataclasses.replace(SETTINGS, **change))
        others.append({**base, "learner_settings": changed})
    identities |= {run_folder.compute_identity(other) for other in others}
    assert len(identities) == 1 + len(others)
    assert {name for change in CHANGES for name in change} == {
        field.name for field in dataclasses.fields(LearnerSettings)
    }


@pytest.mark.parametrize("hashed", [True, False])
@pytest.mark.parametrize("id", ["d-rr-ql", "rr-q", "d-rr-ql-messages", "d-rr-ql-traces"])
def test_what_is_read_goes_on_as_what_was_written(tmp_path, check_same, shrink_tables, id, hashed):
    shrink_tables(32)
    settings = dataclasses.replace(SETTINGS, hashed=hashed)
    options = {"n_cells": 9, "goal": 4, "starts": (0, 8)}
    if id == "d-rr-ql-traces":
        settings = dataclasses.replace(settings, options={"n_kept": 5})
    training, other = (make(id, settings=settings, **options) for _ in range(2))
    training.advance(moves=701)
    assert not hashed or len(training.memory.table.keys) > 32
    run_folder.save_memory(tmp_path / "a.npz", training.memory)
    other.restore(run_folder.load_memory(tmp_path / "a.npz", other.memory))
    check_same(training, other)
    for each in (training, other):
        each.advance(moves=400)
    check_same(training, other)


def sign(path):
    """Makes the manifest say that the file is as it was written."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    (path.parent / run_folder.MANIFEST).write_text(json.dumps({path.name: [digest]}))


@pytest.fixture
def saved(tmp_path):
    training = make()
    training.advance(moves=50)
    run_folder.save_memory(tmp_path / "a.npz", training.memory)
    return tmp_path / "a.npz", training


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[:-40],
        lambda data: b"",
        lambda data: b"not an archive",
        lambda data: data[:100] + bytes([data[100] ^ 1]) + data[101:],
    ],
)
def test_a_file_that_was_changed_is_refused(saved, damage):
    path, training = saved
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InputError, match="its hash differs"):
        run_folder.load_memory(path, training.memory)


def test_a_file_that_is_no_archive_of_arrays_is_refused(saved):
    path, training = saved
    whole = path.read_bytes()
    middle = whole.find(b"table.rows") + 200
    pickled = path.with_name("b.npz")
    np.savez(pickled, **{"table.rows": np.array([{}], dtype=object)})
    single = path.with_name("c.npy")
    np.save(single, np.arange(3))
    broken = whole[:middle] + bytes(60) + whole[middle + 60 :]
    for data in (b"", b"text", whole[:-40], broken, pickled.read_bytes(), single.read_bytes()):
        path.write_bytes(data)
        sign(path)
        with pytest.raises(InputError, match="an npz file of arrays, whole"):
            run_folder.load_memory(path, training.memory)


def test_an_absent_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="a file that a training wrote"):
        run_folder.load_memory(tmp_path / "a.npz", make().memory)


def test_a_file_of_unknown_origin_is_refused(saved):
    path, training = saved
    (path.parent / run_folder.MANIFEST).unlink()
    with pytest.raises(InputError, match="hash differs"):
        run_folder.load_memory(path, training.memory)


@pytest.mark.parametrize(
    ("other", "name"),
    [
        ({"n_cells": 4, "goal": 1, "starts": (0, 3)}, "table.rows"),
        ({"id": "d-rr-ql-traces"}, "own.keys"),
        ({"settings": dataclasses.replace(SETTINGS, hashed=True)}, "table.keys"),
        ({"settings": dataclasses.replace(SETTINGS, modules=SETTINGS.modules[:2])}, "table.rows"),
        ({"settings": dataclasses.replace(SETTINGS, modules=SETTINGS.modules[::2])}, "vetoes.rows"),
    ],
)
def test_another_learners_file_is_refused(saved, other, name):
    path, _ = saved
    with pytest.raises(InputError, match=name.replace(".", r"\.")):
        run_folder.load_memory(path, make(**other).memory)


def test_a_hashed_table_of_another_learner_or_without_room_is_refused(tmp_path, shrink_tables):
    shrink_tables(16)
    settings = dataclasses.replace(SETTINGS, hashed=True)
    training, path = make(settings=settings), tmp_path / "a.npz"
    run_folder.save_memory(path, training.memory)
    with pytest.raises(InputError, match=r"table\.keys"):
        run_folder.load_memory(path, make().memory)
    table = training.memory.table
    table.keys[:] = np.arange(1, 17)
    table.used[0] = 16
    run_folder.save_memory(path, training.memory)
    with pytest.raises(InputError, match="table has room for its keys"):
        run_folder.load_memory(path, training.memory)


def test_a_crash_between_manifest_and_checkpoint_harms_nothing(saved, monkeypatch, check_same):
    path, training = saved
    before = make()
    before.advance(moves=50)
    write = run_folder.write_atomically

    def crash(target, data):
        if target == path:
            raise OSError("no space")
        write(target, data)

    monkeypatch.setattr(run_folder, "write_atomically", crash)
    for _ in range(2):
        training.advance(moves=10)
        with pytest.raises(OSError, match="no space"):
            run_folder.save_memory(path, training.memory)
    after = make()
    after.restore(run_folder.load_memory(path, after.memory))
    check_same(after, before)


def test_a_manifest_that_is_none_is_refused(saved):
    path, training = saved
    (path.parent / run_folder.MANIFEST).write_text("[1, 2")
    with pytest.raises(InputError, match="manifest"):
        run_folder.load_memory(path, training.memory)


DESCRIPTION = run_folder.describe(make(), 3)


@pytest.mark.parametrize(
    "change",
    [
        *({name: None} for name in DESCRIPTION),
        {"task": "moon"},
        {"task": ["corridor"]},
        {"task_options": {"moon": 1}},
        {"task_options": [1]},
        {"learner": "moon"},
        {"seed": -1},
        {"seed": "one"},
        {"learner_settings": {}},
        {"learner_settings": {**DESCRIPTION["learner_settings"], "options": 3}},
        {"learner_settings": {**DESCRIPTION["learner_settings"], "modules": 3}},
        {"learner_settings": {**DESCRIPTION["learner_settings"], "modules": [{"name": "a"}]}},
        {"learner_settings": {**DESCRIPTION["learner_settings"], "exploration": {"moon": 1}}},
        {"learner_settings": {**DESCRIPTION["learner_settings"], "discount": "much"}},
    ],
)
def test_a_wrong_description_is_one_input_error(change):
    with pytest.raises(InputError):
        run_folder.remake({**DESCRIPTION, **change})


def test_a_run_goes_on_from_its_last_checkpoint(tmp_path, check_same):
    training = make()
    folder = RunFolder(tmp_path / "run")
    folder.create(training, 3, {"episodes": 9, "moves": None})
    assert folder.read_ends() == {"episodes": 9, "moves": None}
    fresh, seed = folder.open()
    assert seed == 3
    check_same(fresh, make())
    folder.save(training, training.advance(moves=200))
    opened, _ = folder.open()
    check_same(opened, training)
    opened.advance(moves=1)  # killed before it is saved
    again, _ = folder.open()
    check_same(again, training)


def test_episodes_are_written_in_parts_without_gaps(tmp_path):
    import pyarrow.parquet

    training, whole = make(), make()
    folder = RunFolder(tmp_path)
    folder.create(training, 3)
    for moves in (100, 1, 150):
        folder.save(training, training.advance(moves=moves))
    ended = whole.advance(moves=251)
    table = pyarrow.parquet.read_table(tmp_path / "episodes").to_pydict()
    assert table["episode"] == list(range(len(ended)))
    assert table["moves"] == ended.moves.tolist()
    assert table["return"] == ended.returns.tolist()
    assert table["success"] == ended.find_successes(whole.task).tolist()
    assert len(list((tmp_path / "episodes").iterdir())) in (2, 3)


def test_wrong_run_folders(tmp_path):
    folder = RunFolder(tmp_path)
    with pytest.raises(InputError, match=r"a folder with a config\.json in it"):
        folder.open()
    training = make()
    folder.create(training, 3)
    with pytest.raises(InputError, match="without a run in it"):
        folder.create(training, 3)
    config = json.loads((tmp_path / CONFIG).read_text())
    for text in ("{", "[]", '"a"', "\xff"):
        (tmp_path / CONFIG).write_bytes(text.encode("latin1"))
        with pytest.raises(InputError, match="a JSON object"):
            folder.open()
    for change in ({"seed": 4}, {"learner": "rr-q"}, {"identity": None}):
        (tmp_path / CONFIG).write_text(json.dumps({**config, **change}))
        with pytest.raises(InputError, match="its identity differs"):
            folder.open()
    for ends in ([1], {"episodes": "all"}, None):
        (tmp_path / CONFIG).write_text(json.dumps({**config, "ends": ends}))
        with pytest.raises(InputError, match="ends"):
            folder.read_ends()
    (tmp_path / CONFIG).write_text(json.dumps(config))
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / CHECKPOINT).write_bytes(b"nothing")
    with pytest.raises(InputError, match="hash differs"):
        folder.open()


def test_a_checkpoint_with_the_names_of_before_is_read(tmp_path):
    task = make_task("corridor")
    settings = catalog.make_settings("d-rr-ql", task)
    training = Training(task, "d-rr-ql", settings, np.random.default_rng(3), compiled=False)
    training.advance(moves=40)
    names = {new: old for old, new in run_folder.OLD_NAMES.items()}
    arrays = run_folder.flatten(training.memory)
    path = tmp_path / "last.npz"
    np.savez_compressed(path, **{names.get(name, name): a for name, a in arrays.items()})
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    (tmp_path / "manifest.json").write_text(json.dumps({"last.npz": [digest]}))
    again = run_folder.flatten(run_folder.load_memory(path, training.memory))
    assert {name: a.tobytes() for name, a in again.items()} == {
        name: a.tobytes() for name, a in arrays.items()
    }
