import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hose_mj.errors import InputError
from hose_mj.recording.keep import Keep, Played, RecordingFolder, find_recording

episodes = st.lists(
    st.tuples(st.integers(-9, 9), st.booleans(), st.lists(st.sampled_from("abcde"), max_size=2)),
    min_size=1,
    max_size=30,
)


@given(episodes, st.integers(0, 4), st.integers(0, 3))
def test_what_stays_is_the_last_the_best_and_the_firsts(drawn, last, most_kinds):
    keep = Keep(last, most_kinds)
    played = [Played(i, r, s, tuple(b)) for i, (r, s, b) in enumerate(drawn)]
    for one in played:
        keep.add(one)
    kept = keep.list_kept()
    assert list(kept) == sorted(kept, key=lambda one: one.number)
    assert len(kept) <= last + 2 + most_kinds
    assert set(played[len(played) - min(last, len(played)) :]) <= set(kept)
    best = max(played, key=lambda one: (one.total_reward, -one.number))
    assert "best" in kept[best]
    successes = [one for one in played if one.success]
    if successes:
        assert "first success" in kept[successes[0]]
    kinds = list(dict.fromkeys(kind for one in played for kind in one.breaks))
    for kind in kinds[:most_kinds]:
        first = next(one for one in played if kind in one.breaks)
        assert f"first {kind}" in kept[first]
    assert all(reasons for reasons in kept.values())


def test_the_folder_holds_what_stays_and_its_index(tmp_path):
    folder = RecordingFolder(tmp_path / "recordings", Keep(last=1))
    rewards, written = [1.0, 5.0, 2.0, 3.0, 0.0], []
    for i, reward in enumerate(rewards):
        kinds = ("collision",) if i == 2 else ()
        folder.add(Played(i, reward, False, kinds), lambda i=i: written.append(i) or b"%d" % i)
    names = {f"episode_{i:06d}.rrd" for i in (1, 2, 4)}
    assert {path.name for path in folder.folder.iterdir()} == names | {"index.json"}
    assert written == [0, 1, 2, 3, 4]  # each was the last one once
    index = json.loads((folder.folder / "index.json").read_text())["recordings"]
    reasons = {entry["number"]: entry["reasons"] for entry in index}
    assert reasons == {1: ["best"], 2: ["first collision"], 4: ["last"]}
    assert find_recording(tmp_path).name == "episode_000002.rrd"
    (folder.folder / "episode_000002.rrd").unlink()
    assert find_recording(folder.folder).name == "episode_000001.rrd"


def test_an_episode_that_goes_at_once_is_not_even_encoded(tmp_path):
    folder = RecordingFolder(tmp_path, Keep(last=0))
    folder.add(Played(0, 1.0, False), lambda: b"best")
    folder.add(Played(1, 0.0, False), lambda: pytest.fail("encoded"))
    assert [path.name for path in tmp_path.glob("*.rrd")] == ["episode_000000.rrd"]


def test_nothing_to_look_at_is_named(tmp_path):
    with pytest.raises(InputError, match=r"an \.rrd file"):
        find_recording(tmp_path)
    with pytest.raises(InputError, match="last"):
        Keep(last=-1)
