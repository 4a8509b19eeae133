"""Hand over a stable set of your own: pushes that stay stable though the floor's friction may pull at an angle."""

import numpy as np

import pushplan


class Leaning(pushplan.StableSet):
    """Twists that are stable, and stay so when their direction of travel is off by some degrees to either side."""

    name = "leaning"
    off = np.radians(4.0)

    def __init__(self, chain):
        super().__init__(chain)
        self.exact = pushplan.stable_set(chain, "ecof")

    def contact_margin_values(self, twists):
        """Return the margin (k, n) of each contact, the least over the directions; positive where it is stable."""
        turned = []
        for angle in (-self.off, 0.0, self.off):
            c, s = np.cos(angle), np.sin(angle)
            turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            turned.append(self.exact.contact_margin_values(twists @ turn.T))
        return np.min(turned, axis=0)


if __name__ == "__main__":
    scenario = pushplan.load_scenario("two-crates")
    for kind in ("ecof", Leaning):
        plan = pushplan.plan(scenario, stable_set=kind, time_limit=0.5)
        low, high = scenario.stable_set(plan.stable_set).translation_cone()
        cone = np.degrees([np.arctan2(*low[::-1]), np.arctan2(*high[::-1])])
        print(f"{plan.stable_set}: translations from {cone[0]:+.1f} to {cone[1]:+.1f} deg, {plan.path.cost:.3f} m")
