"""Plan the same push with growing margins: more room for error at every contact, wider turns, a longer path."""

from dataclasses import replace

import pushplan

scenario = pushplan.load_scenario("three-boxes-clutter")
for margin in (0.0, 0.02, 0.05, 0.1):
    careful = replace(scenario, stability=pushplan.StabilitySettings("ecof", margin))
    result = pushplan.plan(careful, time_limit=1.0)
    cost = f"{result.path.cost:.2f} m" if result.solved else "no plan"
    print(f"margin {margin:.2f}: {cost}")
