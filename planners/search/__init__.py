"""The compiled searches: trees from both ends, sparse trees, best-first search over cells of poses."""
