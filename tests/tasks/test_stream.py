import numpy as np
import scipy.stats
from reference_tasks.reference import ReferenceStream

from hose_mj.tasks.stream import draw_below, draw_bits, draw_unit, make_stream


def test_published_vectors():
    # First outputs of splitmix64 from seed 1234567, as published with the generator's ports.
    stream = np.array([1234567], np.uint64)
    assert [int(draw_bits(stream)) for _ in range(5)] == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]


def test_bounded_draws_equal_the_references_and_are_uniform():
    stream, reference = np.array([3], np.uint64), ReferenceStream(3)
    for count in (1, 2, 3, 5, 441, 2**31 - 1, 2**31):
        for _ in range(50):
            assert draw_below(stream, count) == reference.draw_below(count)
    counts = np.bincount([draw_below(stream, 7) for _ in range(7000)], minlength=7)
    assert len(counts) == 7
    assert scipy.stats.chisquare(counts).pvalue > 0.01


def test_the_rejected_fractions_are_those_that_would_be_unfair():
    # 2^32 mod 3 * 2^29 = 2^30: a quarter of the fractions below the bound would be drawn once more.
    stream, reference = np.array([9], np.uint64), ReferenceStream(9)
    count = 3 * 2**29
    drawn = [draw_below(stream, count) for _ in range(2000)]
    assert drawn == [reference.draw_below(count) for _ in range(2000)]
    assert stream[0] == reference.state
    counts = np.bincount(np.array(drawn) // 2**29, minlength=3)
    assert scipy.stats.chisquare(counts).pvalue > 0.01


def test_floats_are_uniform():
    stream = make_stream(np.random.default_rng(0))
    assert stream.dtype == np.uint64
    drawn = [draw_unit(stream) for _ in range(5000)]
    assert scipy.stats.kstest(drawn, "uniform").pvalue > 0.01
