"""The shape of a plate of sockets, when only distances between them are known."""

import numpy as np

from planner.errors import InputError, NoSolutionError
from planner.placing.inputs import IntArray
from planner.placing.rotations import registration
from planner.units import Array

Distance = tuple[int, int, float]  # socket, socket, distance between them [m]


def fitted_shape(keys: IntArray, X: Array, counts: Array, distances: tuple[Distance, ...]) -> Array:
    """Return the sockets in the plate's frame p_PS (K, 3) [m]: the seen shape, the known distances held.

    The first socket is the origin, the second lies on +x, the third in the xy-plane.

    Args:
        keys: (place, socket) of each seen pair, (q, 2) int.
        X: where it was seen in the base frame, (q, 3) [m].
        counts: how often, (q,).
        distances: the distances that are known.

    Raises:
        InputError: a distance is not positive, or names a socket that was never seen.
        NoSolutionError: the plates that were seen share too few sockets to be put together.
    """
    K = int(keys[:, 1].max()) + 1
    for a, b, length in distances:
        if not (min(a, b) >= 0 and max(a, b) < K and a != b):
            raise InputError(
                f"a distance is given between sockets {a + 1} and {b + 1}, but the run names only {K} sockets"
            )
        if not length > 0.0:
            raise InputError(f"the distance between sockets {a + 1} and {b + 1} is {length} m; it must be positive")
    return _own_axes(_held(_averaged(K, keys, X, counts), distances))


def _averaged(K: int, keys: IntArray, X: Array, counts: Array) -> Array:
    """Put the plates together, the one with the most sockets first; (K, 3)."""
    places = sorted(set(keys[:, 0].tolist()), key=lambda k: -int((keys[:, 0] == k).sum()))
    total, weight = np.zeros((K, 3)), np.zeros(K)
    waiting = list(places)
    while waiting:
        known = weight > 0
        place = max(waiting, key=lambda k: (int(known[keys[keys[:, 0] == k, 1]].sum()), -places.index(k)))
        waiting.remove(place)
        at = np.flatnonzero(keys[:, 0] == place)
        x, socket, w = X[at], keys[at, 1], counts[at]
        common = known[socket]
        if known.any() and not common.any():
            raise NoSolutionError(
                f"plate {place + 1} shares no socket with the others; positions of the sockets would help"
            )
        if known.any():
            shape = total[socket[common]] / weight[socket[common], None]
            R, t = registration(shape, x[common], w[common])
            x = x @ R.T + t
        np.add.at(total, socket, x * w[:, None])
        np.add.at(weight, socket, w)
    if not (weight > 0).all():
        raise InputError(f"socket {int(np.argmin(weight)) + 1} was never used, so its position cannot be found")
    return total / weight[:, None]


def _held(shape: Array, distances: tuple[Distance, ...]) -> Array:
    """Return the nearest shape (K, 3) that keeps the distances: Gauss–Newton steps of least norm."""
    if not distances:
        return shape
    a, b = (np.array([d[k] for d in distances], dtype=int) for k in (0, 1))
    wanted, row = np.array([d[2] for d in distances]), np.arange(len(distances))
    for _ in range(50):
        apart = shape[a] - shape[b]
        length = np.linalg.norm(apart, axis=1)
        u = apart / np.maximum(length, 1e-9)[:, None]
        J = np.zeros((len(distances), *shape.shape))
        J[row, a], J[row, b] = u, -u
        shape = shape + (np.linalg.pinv(J.reshape(len(row), -1), rcond=1e-9) @ (wanted - length)).reshape(shape.shape)
    return shape


def _own_axes(shape: Array) -> Array:
    """Return the shape (K, 3) with its first socket at the origin, the second on +x, the third in the xy-plane."""
    apart = shape - shape[0]
    axes = np.zeros((0, 3))
    for v in (*apart[1:], *np.eye(3)):
        rest = v - axes.T @ (axes @ v)
        if len(axes) < 2 and np.linalg.norm(rest) > 1e-3:
            axes = np.vstack([axes, rest / np.linalg.norm(rest)])
    return np.asarray(apart @ np.vstack([axes, np.cross(axes[0], axes[1])]).T)
