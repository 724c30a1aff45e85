"""Points of the unit cube: even in every projection, told by their number alone."""

from functools import partial
from itertools import combinations, permutations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.stats import kstest, qmc
from wearstate.datasets.draws import sampling
from wearstate.datasets.draws.sampling import BLOCK, SET, CubeAxis, Points

METHODS = ("sobol", "latin-hypercube", "random")
EVEN = METHODS[:2]
N = 1000


def stream(seed, *key):
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def dimensions(n):
    return [CubeAxis(name=f"x{slot}", slot=slot) for slot in range(n)]


def points(method, n, n_dimensions=12, seed=0):
    """First points [shape=(n, n_dimensions)]."""
    source = Points(method, partial(stream, seed), dimensions(n_dimensions))
    return np.array([source.at(i) for i in range(n)])


@pytest.mark.parametrize("method", METHODS)
def test_a_point_depends_on_its_number_alone(method):
    there = points(method, 200)
    assert ((there > 0) & (there < 1)).all()
    fresh = Points(method, partial(stream, 0), dimensions(12))
    for i in np.random.default_rng(1).permutation(200):
        assert_array_equal(fresh.at(int(i)), there[i])
    assert (points(method, 20, seed=1) != there[:20]).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_point_far_away_is_that_of_the_whole_sequence(method):
    far = Points(method, partial(stream, 0), dimensions(4))
    last = far.at(10**8 - 1)
    assert_array_equal(far.at(10**8 - 1), last)
    near = far.at(5)
    assert_array_equal(near, Points(method, partial(stream, 0), dimensions(4)).at(5))
    assert (near != last).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_dimension_more_or_in_another_place_moves_no_other(method):
    whole = points(method, 100)
    for kept in ([4], [7, 2, 11], [0, 1, 2, 3]):
        some = [CubeAxis(name=f"x{slot}", slot=slot) for slot in kept]
        source = Points(method, partial(stream, 0), some)
        found = np.array([source.at(i) for i in range(100)])
        assert_array_equal(found, whole[:, kept])
    assert points(method, 3, 0).shape == (3, 0)


def test_another_name_is_another_randomisation():
    for method in METHODS:
        one, other = (
            Points(method, partial(stream, 0), [CubeAxis(name=name, slot=0)]).at(7)[0]
            for name in ("speed", "load")
        )
        assert one != other


@pytest.mark.parametrize("method", EVEN)
def test_every_block_has_one_point_in_each_equal_part(method):
    there = points(method, 40 * BLOCK).reshape(40, BLOCK, -1)
    parts = np.sort(np.floor(BLOCK * there).astype(int), axis=1)
    assert_array_equal(parts, np.broadcast_to(np.arange(BLOCK)[:, None], parts.shape))


@pytest.mark.parametrize("power", [4, 6, 8, 10])
def test_the_first_two_of_a_sobol_sequence_are_a_net(power):
    """Every box of 2^-i by 2^-j with i + j = power holds exactly one of the first 2^power points.

    So does every later run of as many, and scrambling and shuffling must not change it.
    """
    there = points("sobol", 3 * 2**power, SET)[:, :2]
    for run in there.reshape(3, -1, 2):
        for i in range(power + 1):
            boxes = np.floor(run * [2**i, 2 ** (power - i)]).astype(int)
            assert len(np.unique(boxes, axis=0)) == 2**power


def test_the_sequence_is_that_of_scipy():
    """Without scramble and shuffle: the digits of scipy's own points, block by block."""
    source = sampling._Sobol(partial(stream, 0), dimensions(SET))
    source._maps = np.broadcast_to(sampling._POWERS, source._maps.shape)
    source._shifts = np.zeros_like(source._shifts)
    found = np.concatenate([source(block) for block in range(8)])
    expected = qmc.Sobol(SET, scramble=False).random(8 * BLOCK)
    for rows in range(0, 8 * BLOCK, BLOCK):
        one, other = (np.sort(x[rows : rows + BLOCK], axis=0) for x in (found, expected))
        np.testing.assert_allclose(one, other, atol=2.0**-30)  # the middle of a last digit


@pytest.mark.parametrize("method", METHODS)
def test_every_marginal_is_uniform(method):
    there = points(method, N, 40)
    distances = np.array([kstest(column, "uniform").statistic for column in there.T])
    bound = {
        # a (0, 1)-sequence in base 2 misses by log2(n) / 3 + 1 points of n at most; the last,
        # broken block by half a block more (Kuipers and Niederreiter 1974, theorem 3.1)
        "sobol": (np.log2(N) / 3 + 1 + BLOCK / 2) / N,
        # exact at sixteenths but for the broken block; between them 62 free draws of deviation
        # sqrt(62) / 2, of which five, for 40 columns and both signs
        "latin-hypercube": (5 * np.sqrt(N / BLOCK) / 2 + BLOCK / 2) / N,
        "random": 2.2 / np.sqrt(N),  # Kolmogorov: 40 * 2 exp(-2 * 2.2^2) = 0.005
    }
    assert distances.max() < bound[method]


@pytest.mark.parametrize("method", METHODS)
def test_over_seeds_every_place_is_as_likely(method):
    """No corner that every data set begins with: a Sobol sequence as such starts at the origin."""
    first = np.array([points(method, BLOCK, 3, seed) for seed in range(300)])
    lowest = first.min(axis=1) if method in EVEN else first[:, 0] / BLOCK
    for column in lowest.T:
        # of the lowest sixteenth; Kolmogorov: 3 * 2 exp(-2 * 2.2^2) = 4e-4
        assert kstest(BLOCK * column, "uniform").statistic < 2.2 / np.sqrt(300)


def pair_discrepancies(method, n, n_dimensions=9):
    """Centred L2 discrepancy of every two dimensions, by whether a sequence holds both."""
    same, apart = [], []
    for seed in range(3):
        there = points(method, n, n_dimensions, seed)
        for one, other in combinations(range(n_dimensions), 2):
            found = np.sqrt(qmc.discrepancy(there[:, [one, other]]))
            (same if one // SET == other // SET else apart).append(found)
    return np.array(same), np.array(apart)


@pytest.mark.parametrize("n", [120, 480, 1000])
def test_projections_on_two_dimensions_are_more_even_than_free_draws(n):
    free = np.mean(np.concatenate(pair_discrepancies("random", n)))
    same, apart = pair_discrepancies("sobol", n)
    hypercube = np.concatenate(pair_discrepancies("latin-hypercube", n))
    # measured at 120, 480, 1000: .25, .11, .09 in one sequence, .35, .29, .28 across, .43 to .39
    # for the hypercube; its 1000 points can be no better, as each pair is free within sixteenths
    assert same.mean() < (0.3 if n == 120 else 0.15) * free
    assert apart.mean() < 0.42 * free
    assert hypercube.mean() < 0.5 * free
    assert same.mean() < apart.mean() < hypercube.mean()
    # not the mean alone: the worst pair is better than the mean of free draws
    assert max(same.max(), apart.max()) < free


def told_by(one, other, neighbours):
    """Share of the variance of one draw that its nearest ones in another tell, each left out."""
    values = other[np.argsort(one)]
    n, half = len(values), neighbours // 2
    sums = np.concatenate([[0.0], np.cumsum(values)])
    low = np.clip(np.arange(n) - half, 0, n - neighbours - 1)
    mean = (sums[low + neighbours + 1] - sums[low] - values) / neighbours
    return 1 - np.mean((values - mean) ** 2) / np.var(values)


@pytest.mark.parametrize("method", METHODS)
def test_no_dimension_tells_another(method):
    """Points may not lie on curves: a severity could be read from a speed.

    The further dimensions of one Sobol sequence do: .3 to .8 of a severity from the tenth of them.
    """
    worst = -np.inf
    for seed, n in ((1, 128), (2, 320), (3, 640), (4, N)):
        there = points(method, n, 9, seed)
        worst = max(
            worst,
            *(
                told_by(there[:, one], there[:, other], k)
                for one, other in permutations(range(9), 2)
                for k in (2, 4, 8)
            ),
        )
    # measured at worst .21 for sobol (128 points, the third of a sequence), .13 for free draws
    assert worst < 0.27


@pytest.mark.parametrize("method", METHODS)
def test_neighbours_in_number_are_as_good_as_free(method):
    """Nor does the place in the file tell anything: records of one machine follow each other."""
    there = points(method, 4096, 6)
    for step in (1, 2, 8, BLOCK, 64):
        for column in there.T:
            found = np.corrcoef(column[:-step], column[step:])[0, 1]
            # a block holds one of each sixteenth: neighbours in it are apart by -1/15; otherwise
            # deviation 1/64, of which four and a half for 30 pairs
            assert abs(found) < 1 / (BLOCK - 1) + 4.5 / 64
    # even and odd numbers, the records of two-record machines, share every part of the range
    for column in there.T:
        even = np.bincount((8 * column[::2]).astype(int), minlength=8)
        # 2048 of 8 parts: 256 with a deviation of 15 for free draws, less for even ones
        assert np.abs(even - 256).max() < 5 * 15


def test_an_unknown_method_is_refused():
    with pytest.raises(KeyError):
        Points("halton", partial(stream, 0), dimensions(1))
