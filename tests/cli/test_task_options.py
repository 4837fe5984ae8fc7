import pytest

from hose_mj.cli.task_options import read_options
from hose_mj.errors import InputError


def test_values_are_read_as_python_or_as_words():
    words = ["n_robots=2", "goal=(3, 0)", "collision=robots", "single_agent=True", "reward=-1e1"]
    assert read_options(words) == {
        "": {
            "n_robots": 2,
            "goal": (3, 0),
            "collision": "robots",
            "single_agent": True,
            "reward": -10.0,
        }
    }


def test_groups():
    words = ["a=1", "source.a=2", "target.b=x=y"]
    found = read_options(words, ("source", "target"))
    assert found == {"": {"a": 1}, "source": {"a": 2}, "target": {"b": "x=y"}}


@pytest.mark.parametrize("word", ["a", "=1", "other.a=1", ".a=1", "source.=1"])
def test_wrong_words(word):
    with pytest.raises(InputError, match="option"):
        read_options([word], ("source",))


def test_an_option_twice():
    with pytest.raises(InputError, match="only once"):
        read_options(["a=1", "a=2"])
    with pytest.raises(InputError, match="only once"):
        read_options(["source.a=1", "source.a=2"], ("source",))
