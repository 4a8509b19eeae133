"""A package of somebody else: what docs/contributing.md says of each extension, tried by `test_recipes.py`."""
