"""The compiled searches: trees from both ends, sparse trees, cells of poses, and ways to guide them."""
