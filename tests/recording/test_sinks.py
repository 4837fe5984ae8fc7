import threading

import pytest

from hose_mj.recording.sinks import Background

SCENE, SAMPLES, ENDING = object(), object(), object()


class Notes:
    def __init__(self):
        self.calls = []

    def begin(self, scene):
        self.calls.append("begin")

    def add(self, samples):
        self.calls.append("add")

    def end(self, ending):
        self.calls.append("end")


class Hanging(Notes):
    def __init__(self):
        super().__init__()
        self.release = threading.Event()

    def add(self, samples):
        self.release.wait()
        super().add(samples)


class Failing(Notes):
    def add(self, samples):
        raise OSError("the disk is full")


def play(background, n):
    background.begin(SCENE)
    for _ in range(n):
        background.add(SAMPLES)
    background.end(ENDING)


def test_a_lossless_sink_gets_everything_in_order_also_twice():
    notes = Notes()
    background = Background(notes, "file", lossy=False, most=2)
    for _ in range(2):
        play(background, 20)
    assert notes.calls == 2 * ["begin", *["add"] * 20, "end"]


def test_a_sink_that_hangs_forever_does_not_hold_up_the_run(capsys):
    notes, gone = Hanging(), []
    background = Background(
        notes, "viewer", lossy=True, most=3, patience_s=0.01, give_up=lambda: gone.append(1)
    )
    play(background, 50)  # returns although nothing was taken
    play(background, 50)
    assert notes.calls == ["begin"]
    assert gone
    message = capsys.readouterr().err
    assert message.count("not all of this reaches the viewer") == 1
    notes.release.set()


def test_a_slow_sink_misses_stretches_but_hears_the_end():
    notes = Hanging()
    background = Background(notes, "viewer", lossy=True, most=4, patience_s=30.0)
    background.begin(SCENE)
    for _ in range(50):
        background.add(SAMPLES)
    notes.release.set()
    background.end(ENDING)
    assert notes.calls[0] == "begin"
    assert notes.calls[-1] == "end"
    assert len(notes.calls) < 52


def test_what_fails_stops_the_run_only_if_it_is_a_file(capsys):
    with pytest.raises(OSError, match="disk is full"):
        play(Background(Failing(), "file", lossy=False), 3)
    play(Background(Failing(), "viewer", lossy=True), 3)
    assert "disk is full" in capsys.readouterr().err
