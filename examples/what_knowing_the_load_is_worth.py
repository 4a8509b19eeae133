"""Compare stable sets: how tight a chain can be turned, by what is known of the loads on the floor."""

import pushplan

KNOWN = {
    "ecof": "the loads are known (exact)",
    "cof": "the loads are known (Algorithm 2)",
    "stable": "only their centres are (STABLE)",
}

chain = pushplan.load_scenario("two-crates").chain
sets = [pushplan.stable_set(chain, name) for name in KNOWN]
for stable in sets:
    radii = stable.turning_radii()
    print(f"{KNOWN[stable.name]:35} left {radii.left:.3f} m, right {radii.right:.3f} m")
pushplan.plot_stable_sets(chain, sets, "sets.png")
