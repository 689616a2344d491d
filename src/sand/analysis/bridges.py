"""Contacts that alone join two parts of a body (bridges of the graph of contacts), and sums over these parts."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["SpanningTrees"]


class SpanningTrees:
    """Breadth-first spanning trees of bodies, joined at one further node, the root.

    Nodes are numbered by their position in breadth-first order, the root is 0: children of a node follow each other,
    and all of one depth follow those of lower depths. Sums over the subtree below each node take a pass over depths.

    Parameters
    ----------
    count : int
        Number N ≥ 1 of grains.
    pairs : ndarray
        Contacts (C, 2).
    tops : ndarray
        One grain of each body (K,), the top of its tree.

    Attributes
    ----------
    grain : ndarray
        Grain of each node (N + 1,); N stands for the root.
    parent : ndarray
        Parent of each node (N + 1,); −1 for the root.
    contact : ndarray
        Contact of each node with its parent (N + 1,); −1 for the root and the top of each tree.
    """

    def __init__(self, count: int, pairs: np.ndarray, tops: np.ndarray):
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import breadth_first_order

        ends = np.vstack((np.asarray(pairs, np.int64), np.column_stack((tops, np.full(len(tops), count)))))
        numbers = np.arange(1, len(ends) + 1)  # 0 would be no edge
        graph = coo_array((numbers, (ends[:, 0], ends[:, 1])), shape=(count + 1, count + 1)).tocsr()
        graph = graph + graph.T
        self.grain, before = breadth_first_order(graph, count)
        self._node = np.empty(count + 1, np.int64)
        self._node[self.grain] = np.arange(count + 1)
        above = before[self.grain[1:]]
        self.parent = np.concatenate(([-1], self._node[above]))
        edge = np.asarray(graph[self.grain[1:], above]).ravel() - 1
        self.contact = np.concatenate(([-1], np.where(edge < len(pairs), edge, -1)))
        first_child = np.flatnonzero(np.diff(self.parent, prepend=-2))  # of all nodes with the same parent
        self._first_child, begin, end = first_child, 0, 1
        self._depths = list[tuple[slice, np.ndarray]]()  # nodes of a depth, and the first children among them
        while end <= count:
            begin, end = end, int(np.searchsorted(self.parent, end))
            here = first_child[np.searchsorted(first_child, begin) : np.searchsorted(first_child, end)]
            self._depths.append((slice(begin, end), here))
        self._outside_trees = self._node[ends[np.setdiff1d(np.arange(len(pairs)), self.contact)]]

    def over_subtrees(self, combine: np.ufunc, values: np.ndarray) -> np.ndarray:
        """Combine the values of all grains below and at each node, with `np.add`, `np.minimum` or `np.maximum`.

        Parameters
        ----------
        combine : ufunc
            How two values are combined.
        values : ndarray
            Values of the nodes (N + 1, …).
        """
        found = np.array(values)
        for depth, first_child in reversed(self._depths):
            at = self.parent[first_child]
            found[at] = combine(found[at], combine.reduceat(found[depth], first_child - depth.start, axis=0))
        return found

    def bridges(self) -> np.ndarray:
        """Nodes whose contact with the parent alone joins the grains below it to the rest of the body.

        Nodes get a second number, in preorder, so that those of a subtree of s nodes are p … p + s − 1: its contact is
        a bridge if no other contact leads from them to a number outside of these (Tarjan 1974).
        """
        size = self.over_subtrees(np.add, np.ones(len(self.grain), np.int64))
        before = np.cumsum(size) - size  # nodes below and at all nodes before
        children = np.diff(self._first_child, append=len(size))
        number = 1 + before - np.repeat(before[self._first_child], children)
        for depth, _ in self._depths:
            number[depth] += number[self.parent[depth]]
        low, high, (one, other) = number.copy(), number.copy(), self._outside_trees.T
        for here, there in ((one, other), (other, one)):
            np.minimum.at(low, here, number[there])
            np.maximum.at(high, here, number[there])
        low, high = self.over_subtrees(np.minimum, low), self.over_subtrees(np.maximum, high)
        return np.flatnonzero((low >= number) & (high < number + size) & (self.contact >= 0))

    def at_nodes(self, values: Any) -> np.ndarray:
        """Values of the grains (N, …) in the order of the nodes (N + 1, …), with 0 for the root."""
        values = np.asarray(values)
        return np.concatenate((np.zeros_like(values[:1]), values[self.grain[1:]]))

    def nodes_of(self, grains: np.ndarray) -> np.ndarray:
        """Nodes of grains."""
        return self._node[grains]
