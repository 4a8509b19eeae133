"""Pushes with real contacts in MuJoCo: the judge of what the stable sets promise."""
