"""Connected components of pairs: who belongs together, by whom one belongs to."""

import numpy as np
import numpy.typing as npt


def first_of_component(pairs: npt.NDArray[np.int64], count: int) -> npt.NDArray[np.int64]:
    """The first member (count,) of the component of each, by pairs (K, 2) that join two of them."""
    from scipy.sparse import coo_array  # a third of a second, and the HTTP process never asks
    from scipy.sparse.csgraph import connected_components

    one, other = pairs.reshape(-1, 2).T
    graph = coo_array((np.ones(one.size, dtype=np.int8), (one, other)), shape=(count, count))
    labels = connected_components(graph, directed=False)[1]
    firsts = np.unique(labels, return_index=True)[1]
    return np.asarray(firsts[labels], dtype=np.int64)
