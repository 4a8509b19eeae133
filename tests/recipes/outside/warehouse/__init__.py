"""A third-party package with the extensions of docs/contributing.md; `test_recipes.py` uses it."""
