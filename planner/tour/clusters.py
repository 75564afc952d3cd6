"""Which poses lie together: sets that guide cuts and branching, and decide nothing by themselves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from planner.tour.instance import Instance, IntArray
from planner.units import Array

BoolArray = NDArray[np.bool_]

_COARSEST = 5  # clusters in the coarsest partition
_RATIO = 1.3  # from one partition to the next finer one


@dataclass(frozen=True)
class Clusters:
    """Average-linkage clusters of the m nodes.

    Attributes:
        sets: (k, m) bool, all clusters of the tree; where there is a dummy node, each with and without it.
        partitions: (l, m) int, the cluster of each node, from coarse to fine; the dummy stands alone.

    """

    sets: BoolArray
    partitions: IntArray


def find_clusters(instance: Instance) -> Clusters:
    """Cluster the real nodes by their costs."""
    n = instance.n
    tree: Array = linkage(instance.cost[:n, :n][np.triu_indices(n, 1)].astype(float), "average")
    member = np.eye(n, dtype=np.bool_)
    for a, b in tree[:, :2].astype(int):
        member = np.concatenate((member, member[[a]] | member[[b]]))
    size = member.sum(axis=1)
    sets = member[(size >= 2) & (size <= n - 2)]
    steps = int(np.log(max(n / 4.0 / _COARSEST, 1.0)) / np.log(_RATIO)) + 1
    counts = np.unique(np.rint(_COARSEST * _RATIO ** np.arange(steps)).astype(int))
    partitions = np.array([fcluster(tree, count, "maxclust") for count in counts], dtype=np.int64)
    if len(instance.cost) > n:
        sets = np.concatenate([np.pad(sets, ((0, 0), (0, 1)), constant_values=dummy) for dummy in (False, True)])
        partitions = np.pad(partitions, ((0, 0), (0, 1)))
    return Clusters(sets, partitions)


def links(x: Array, partition: IntArray) -> Array:
    """Return (p, p): how strongly the parts are linked at ``x``, by number of part, 0 on the diagonal."""
    tail, head = np.nonzero(x)
    parts = int(partition.max()) + 1
    between = np.zeros((parts, parts))
    np.add.at(between, (partition[tail], partition[head]), x[tail, head])  # in order: the same on every machine
    np.fill_diagonal(between, 0.0)
    return between


def torn_unions(x: Array, partitions: IntArray, count: int) -> list[BoolArray]:
    """Return unions of two clusters, linked by about half a leg, coarse partitions first: a leg between clusters."""
    found: dict[bytes, BoolArray] = {}
    for partition in partitions:
        between = links(x, partition)
        once = np.abs(between.sum(axis=1) - 2.0) < 0.1
        half = (np.abs(between - 0.5) < 0.3) & once[:, None] & once[None, :]
        for a, b in np.argwhere(np.triu(half)):
            union = (partition == a) | (partition == b)
            found.setdefault(union.tobytes(), union)
        if len(found) >= count:
            break
    return list(found.values())[:count]


def torn(x: Array, sets: BoolArray, count: int) -> IntArray:
    """Return which of the sets (k, m) are left between two and four times at ``x``, those nearest to three first."""
    tail, head = np.nonzero(np.triu(x, 1))
    leaving = ((sets[:, tail] != sets[:, head]) * x[tail, head]).sum(axis=1)
    off = np.round(np.abs(leaving - 3.0), 6)
    order = np.argsort(off, kind="stable")
    chosen: IntArray = order[off[order] < 0.95][:count]
    return chosen
