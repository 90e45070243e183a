"""Clusters: groove points that hang together (thesis 5.1.6, the operator's choice made by size)."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree


def euclidean_clusters(points: Float[ndarray, "n 3"], radius: float) -> Int[ndarray, "n"]:
    """For each point the rank of its cluster, 0 the largest; points nearer than `radius` [m] are of one cluster."""
    if len(points) == 0:
        return np.zeros(0, np.int64)
    pairs = KDTree(points).query_pairs(radius, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    count, label = connected_components(links, directed=False)
    rank = np.empty(count, np.int64)
    rank[np.argsort(-np.bincount(label), kind="stable")] = np.arange(count)
    return rank[label]
