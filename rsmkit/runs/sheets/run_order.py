"""In which order the runs of a design are made by hand: at random, within blocks and whole plots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["randomised_order"]


def randomised_order(
    runs: int,
    seed: int,
    *,
    blocks: Sequence[int] = (),
    whole_plots: Sequence[int] = (),
    first: Sequence[int] = (),
) -> tuple[int, ...]:
    """Draw the order of the runs.

    Blocks keep their order, for they are days or batches; whole plots, whose factors are hard to change, stay
    together in a random order; the runs inside are in a random order. What drifts with time then differs
    from run to run by chance only, and no factor is taken for it.

    Parameters
    ----------
    runs : int
        Number of runs.
    seed : int
        The same seed gives the same order.
    blocks, whole_plots : sequence of int, optional
        Of each run; all in one when empty.
    first : sequence of int, optional
        Runs made already, from 0: they keep the first places, as given.

    Returns
    -------
    tuple of int
        The run, from 0, that is made first, the one that is made second, and so on.

    References
    ----------
    R. A. Fisher, The Design of Experiments (1935), sections 5 to 10.
    """
    rng = np.random.default_rng(seed)
    block = np.asarray(blocks) if len(blocks) else np.zeros(runs, int)
    plot = np.asarray(whole_plots) if len(whole_plots) else np.arange(runs)
    done = set(first)
    order = list(first)
    for name in np.unique(block):
        rows = np.array([row for row in np.flatnonzero(block == name) if row not in done], int)
        for which in rng.permutation(np.unique(plot[rows])):
            order += rng.permutation(rows[plot[rows] == which]).tolist()
    return tuple(order)
