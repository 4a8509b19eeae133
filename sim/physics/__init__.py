"""Simulation of pushes with real contacts in MuJoCo, as an independent check of the stable sets."""
