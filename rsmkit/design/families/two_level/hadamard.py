"""Orthogonal matrices of signs, and conference matrices: what screening designs are made of."""

from __future__ import annotations

from itertools import product

import numpy as np

from rsmkit.language.space import Floats

__all__ = ["conference", "next_size", "plackett_burman_columns"]

# First rows of Plackett & Burman (1946), Biometrika 33(4), 305-325, which no prime gives.
CYCLIC = {
    16: "++++-+-++--+---",
    32: "----+-+-+++-++---+++++--++-+--+",
    36: "-+-+++---+++++-+++--+----+-+-++--+-",
}
BLOCKS = {
    28: (
        "+-++++----+---+--+++-+-++-+",
        "++-+++-----++--+---++++-++-",
        "-+++++---+---+--+-+-+-++-++",
        "---+-++++--+-+---++-+++-+-+",
        "---++-++++----++--++--++++-",
        "----+++++-+-+---+--+++-+-++",
        "+++---+-+--+--+-+-+-++-+++-",
        "+++---++-+--+----+++-++--++",
        "+++----++-+--+-+---++-+++-+",
    )
}
"""The first of three groups of rows; the others shift it by whole blocks of columns."""
WILLIAMSON = {92: ("+++++-++---+", "+-+++--++-+-", "+-+--+++++--", "+--++-+-+---")}
"""First halves of the first rows of four symmetric circulants whose squares add up to the unit matrix."""
MOST_FLIPS = 200


def plackett_burman_columns(runs: int) -> Floats | None:
    """Orthogonal columns of +-1, shape (runs, runs - 1); None where no construction is known.

    Parameters
    ----------
    runs : int
        Multiple of four.

    Notes
    -----
    Up to 100 runs the designs of Plackett & Burman (1946): cyclic shifts of one row (for a prime runs - 1 the
    quadratic residues), with 28 runs of three blocks; by Paley's constructions over a finite field (52, 76,
    100), or by doubling (40, 56, 64, 88, 96). 64 runs double the quadratic residues of 31, not the regular
    fraction of 32 runs, so that 62 factors are free of complete aliasing. 92 runs, which the paper leaves
    out, are Williamson's.
    In these a column that stands in most of the worst triples is the last, so that it is the last to be used.
    """
    row = _published_row(runs)
    if row is not None:
        return np.vstack([_circulant(row), -np.ones((1, runs - 1))])
    if runs in BLOCKS:
        first = np.array([_signs(text) for text in BLOCKS[runs]])
        shifted = [np.roll(first, turn * len(first), axis=1) for turn in range(3)]
        return np.vstack([*shifted, -np.ones((1, runs - 1))])
    matrix = _hadamard(runs)
    return None if matrix is None else _worst_last((matrix * matrix[:, :1])[:, 1:])


def next_size(runs: int) -> int:
    """The next larger number of runs that a construction is known for."""
    return next(n for n in range(runs + 4, 2 * runs + 4, 4) if _hadamard(n) is not None)


def conference(k: int) -> Floats:
    """Zero diagonal, +-1 elsewhere, as orthogonal as can be, shape (k, k)."""
    if k % 2 == 0 and _field(k - 1):
        return _bordered(_quadratic_characters(k - 1), 1.0 if (k - 1) % 4 == 1 else -1.0)
    if k % 4 == 0 and _field(k // 2 - 1) and (k // 2 - 1) % 4 == 3:  # doubling a skew matrix
        inner, identity = _bordered(_quadratic_characters(k // 2 - 1), -1.0), np.eye(k // 2)
        return np.block([[inner, inner + identity], [inner - identity, -inner]])
    return _largest_determinant(k)


def _published_row(runs: int) -> Floats | None:
    """The row whose cyclic shifts make the design: +1 first, then the quadratic character of 1, 2, 3, ..."""
    if runs in CYCLIC:
        return _signs(CYCLIC[runs])
    if not (_is_prime(runs - 1) and runs % 4 == 0):
        return None
    row = _quadratic_characters(runs - 1)[:, 0].copy()
    row[0] = 1.0
    return row


def _worst_last(columns: Floats) -> Floats:
    """Move the column that is in most of the triples with the largest sum of products to the end."""
    largest, counts = 0.0, np.zeros(columns.shape[1], int)
    for a in range(columns.shape[1]):
        sums = np.abs((columns * columns[:, [a]]).T @ columns)
        sums[a], sums[:, a], sums[np.diag_indices_from(sums)] = 0.0, 0.0, 0.0
        if sums.max() > largest:
            largest, counts = float(sums.max()), 0 * counts
        counts[a] = int((sums == largest).sum())
    worst = int(counts.argmax())
    return np.hstack([np.delete(columns, worst, axis=1), columns[:, [worst]]])


def _hadamard(n: int) -> Floats | None:
    """Square matrix of +-1 with orthogonal rows, where a construction is known."""
    if n <= 2:
        return np.array([[1.0, 1.0], [1.0, -1.0]])[:n, :n]
    if _field(n - 1) and (n - 1) % 4 == 3:
        return np.eye(n) + _bordered(_quadratic_characters(n - 1), -1.0)
    if n % 4 == 0 and _field(n // 2 - 1) and (n // 2 - 1) % 4 == 1:
        inner, identity = _bordered(_quadratic_characters(n // 2 - 1), 1.0), np.eye(n // 2)
        return np.block([[inner + identity, inner - identity], [inner - identity, -inner - identity]])
    if n in WILLIAMSON:
        a, b, c, d = (_circulant(_signs(half + half[:0:-1])) for half in WILLIAMSON[n])
        return np.block([[a, b, c, d], [-b, a, -d, c], [-c, d, a, -b], [-d, -c, b, a]])
    half = _hadamard(n // 2) if n % 2 == 0 else None
    return None if half is None else np.block([[half, half], [half, -half]])


def _signs(text: str) -> Floats:
    return np.array([1.0 if sign == "+" else -1.0 for sign in text])


def _circulant(row: Floats) -> Floats:
    """Each row the one above, shifted by one."""
    return np.stack([np.roll(row, turn) for turn in range(len(row))])


def _bordered(core: Floats, sign: float) -> Floats:
    ones = np.ones((1, len(core)))
    return np.block([[np.zeros((1, 1)), ones], [sign * ones.T, core]])


def _field(q: int) -> tuple[int, int] | None:
    """An odd prime and its power, 1 to 3, that give q."""
    for power in (1, 2, 3):
        root = round(max(q, 0) ** (1.0 / power))
        if root**power == q and _is_prime(root):
            return root, power
    return None


def _is_prime(q: int) -> bool:
    return q > 2 and all(q % d for d in range(2, int(q**0.5) + 1))


def _quadratic_characters(q: int) -> Floats:
    """Matrix chi(a - b) over the field of q elements: 1 for squares, -1 for the rest, 0 for zero."""
    p, power = _field(q) or (q, 1)
    elements = np.array(list(product(range(p), repeat=power)))  # digits, that of 1 last
    places = p ** np.arange(power)[::-1]
    chi = np.full(q, -1.0)
    chi[[int(places @ square) for square in _squares(elements, p)]] = 1.0
    chi[0] = 0.0
    return np.asarray(chi[((elements[:, None, :] - elements[None, :, :]) % p) @ places])


def _squares(elements: Floats, p: int) -> list[Floats]:
    """The squares of polynomials of degree below m, modulo p and one without roots of degree m <= 3."""
    power = elements.shape[1]
    monic = next(
        tail
        for tail in elements.tolist()
        if all(np.polyval([1, *tail], x) % p for x in range(p)) or power == 1
    )
    found = []
    for element in elements:
        square = np.convolve(element, element) % p
        for place in range(power - 1):  # x^m is minus the tail
            square[place : place + power + 1] = (
                square[place : place + power + 1] - square[place] * np.array([1, *monic])
            ) % p
        found.append(square[power - 1 :])
    return found


def _largest_determinant(k: int) -> Floats:
    rng = np.random.default_rng(k)
    best, best_value = np.zeros((k, k)), -np.inf
    for _ in range(MOST_FLIPS):
        matrix = rng.choice([-1.0, 1.0], (k, k))
        np.fill_diagonal(matrix, 0.0)
        value = np.linalg.slogdet(matrix)[1]
        improved = True
        while improved:
            improved = False
            for i in range(k):
                for j in range(k):
                    if i != j:
                        matrix[i, j] *= -1.0
                        trial = np.linalg.slogdet(matrix)[1]
                        if trial > value + 1e-9:
                            value, improved = trial, True
                        else:
                            matrix[i, j] *= -1.0
        if value > best_value + 1e-9:
            best, best_value = matrix.copy(), value
    return best
