"""Reachable directions: W_j = (C + C^T) * M_j and the lists A(P_t, P_i) read from it.

Which of P_t and P_i moves, the paper leaves open. Here A_j(P_t, P_i) = 1 means: the incoming part
P_i leaves the target P_t along j (the column of W_j that belongs to P_t). The literal row reading,
P_t displaced along j, flips every sign and contradicts the paper's table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from planning.feasibility.directions import DIRECTIONS


def reachable_matrices(
    contact: np.ndarray, free: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return W_j per direction: W_j[i, k] = 1 if part i touches part k and leaves it along j.

    Args:
        contact: (n, n) strictly upper triangular C.
        free: Per direction the (n, n) matrix M_j.
    """
    return {j: (contact + contact.T) * free[j] for j in DIRECTIONS}


def touching(contact: np.ndarray, target: Sequence[int], incoming: Sequence[int]) -> bool:
    """Say whether any part of one combined part touches any of the other: C of combined parts."""
    return bool((contact + contact.T)[np.ix_(incoming, target)].any())


def reachable_directions(
    contact: np.ndarray,
    free: Mapping[str, np.ndarray],
    target: Sequence[int],
    incoming: Sequence[int],
) -> dict[str, int]:
    """Return A(P_t, P_i) of two combined parts, given by the indices of their members.

    A combined part moves as one: it is free where all its members are (AND over M), and in contact
    where any of them is (OR over C).
    """
    touches = touching(contact, target, incoming)
    pairs = np.ix_(incoming, target)
    return {j: int(touches and bool(free[j][pairs].all())) for j in DIRECTIONS}
