"""Plan the same push with growing margins: what every contact has to spare at least, and what the path costs."""

import pushplan

scenario = pushplan.load_scenario("two-crates")
for margin in (0.005, 0.02, 0.05, 0.1):
    result = pushplan.plan(scenario.with_margin(margin), time_limit=1.0)
    found = f"{result.path.cost:.2f} m, margin {result.min_margin:.3f}" if result.solved else "no plan"
    print(f"asked for {margin:.2f}: {found}")
