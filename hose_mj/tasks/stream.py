"""Random numbers that compiled and plain Python code draw alike: splitmix64 in an array of one.

A stream is a uint64 array of length 1, seeded from a numpy Generator; each draw advances it in
place. Generator of Steele, Lea and Flood (2014), bounded integers without bias after Lemire (2019).
"""

import numpy as np
import numpy.typing as npt

from hose_mj.jit import inlined

Stream = npt.NDArray[np.uint64]


def make_stream(generator: np.random.Generator) -> Stream:
    """Makes a stream whose seed is drawn from the generator."""
    return generator.integers(0, 2**64, size=1, dtype=np.uint64)


@inlined
def draw_bits(stream: Stream) -> np.uint64:
    """Draws 64 random bits (uint64)."""
    stream[0] += np.uint64(0x9E3779B97F4A7C15)
    bits = stream[0]
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))


@inlined
def draw_below(stream: Stream, count: int) -> np.int64:
    """Draws an integer uniformly from 0 .. count - 1, for a count of 1 to 2^31."""
    bound = np.uint64(count)
    product = (draw_bits(stream) >> np.uint64(32)) * bound
    low = product & np.uint64(0xFFFFFFFF)
    if low < bound:
        # The first 2^32 mod count fractions would make some results likelier than others.
        unfair = (np.uint64(0x100000000) - bound) % bound
        while low < unfair:
            product = (draw_bits(stream) >> np.uint64(32)) * bound
            low = product & np.uint64(0xFFFFFFFF)
    return np.int64(product >> np.uint64(32))


@inlined
def draw_unit(stream: Stream) -> float:
    """Draws a float uniformly from the multiples of 2^-53 in [0, 1)."""
    return np.float64(draw_bits(stream) >> np.uint64(11)) * 2.0**-53
