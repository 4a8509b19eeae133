"""Record a run, read it back, check that nothing is lost, and write the motion as a table and as a page."""

import numpy as np

import pushplan
from pushplan.logging.page import write_html
from pushplan.logging.tables import write_csv

run = pushplan.run(pushplan.load_scenario("one-box"), log="run.mcap", time_limit=0.5)
log = pushplan.load_run("run.mcap")

assert np.array_equal(log.execution.poses, run.execution.poses)
print(f"{log.scenario.name}: {log.plan.path.cost:.3f} m, {len(log.execution.t)} samples, {log.outcome}")
write_csv(log, "run.csv")
write_html(log, "run.html")
