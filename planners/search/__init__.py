"""The compiled searches: trees from both ends, sparse trees, best-first search and flooding over cells of poses."""
