"""The tables of Planner Arena (Moll, Sucan and Kavraki 2015), and our own beside them.

Planner Arena takes what follows the third column of `runs` for attributes, what follows the twelfth of `experiments`
for parameters of the problem, and what follows the second of `progress` for measurements over time. What it has no
place for (keys, messages, arcs) is in tables of our own, which it does not look at.
"""

from __future__ import annotations

from pushplan.bench.processes.outcome import STATUSES

EXPERIMENTS = (
    ("id", "INTEGER PRIMARY KEY AUTOINCREMENT"),
    ("name", "VARCHAR(512)"),
    ("totaltime", "REAL"),
    ("timelimit", "REAL"),
    ("memorylimit", "REAL"),
    ("runcount", "INTEGER"),
    ("version", "VARCHAR(128)"),
    ("hostname", "VARCHAR(1024)"),
    ("cpuinfo", "TEXT"),
    ("date", "DATETIME"),
    ("seed", "VARCHAR(24)"),
    ("setup", "TEXT"),
)

PARAMETERS = (
    ("drive", "TEXT"),
    ("instance", "INTEGER"),
    ("objects", "INTEGER"),
    ("obstacles", "INTEGER"),
)
"""Of a problem: the pusher's drive, seed of its generator, numbers of objects and obstacles, as far as they differ
between the problems of a generator. The order is that in which OMPL's reader adds them."""

PLANNER_CONFIGS = (
    ("id", "INTEGER PRIMARY KEY AUTOINCREMENT"),
    ("name", "VARCHAR(512) NOT NULL"),
    ("settings", "TEXT"),
)

ENUMS = (("name", "VARCHAR(512)"), ("value", "INTEGER"), ("description", "TEXT"))

RUNS = (
    ("id", "INTEGER PRIMARY KEY AUTOINCREMENT"),
    ("experimentid", "INTEGER"),
    ("plannerid", "INTEGER"),
)

ATTRIBUTES = (
    ("time", "REAL"),
    ("solved", "BOOLEAN"),
    ("status", "ENUM"),
    ("correct_solution", "BOOLEAN"),
    ("seed", "INTEGER"),
    ("first_solution_time", "REAL"),
    ("solution_length", "REAL"),
    ("lower_bound", "REAL"),
    ("solution_segments", "INTEGER"),
    ("solution_clearance", "REAL"),
    ("solution_difference", "REAL"),
    ("goal_angle_error", "REAL"),
    ("margin", "REAL"),
    ("min_margin", "REAL"),
    ("min_dynamic_margin", "REAL"),
    ("trial_success", "REAL"),
    ("duration", "REAL"),
    ("extensions", "INTEGER"),
    ("memory", "REAL"),
    ("posing_time", "REAL"),
    ("timing_time", "REAL"),
    ("execution_time", "REAL"),
    ("logging_time", "REAL"),
    ("validation_time", "REAL"),
    ("trials_time", "REAL"),
    ("overhead_time", "REAL"),
    ("total_time", "REAL"),
)
"""Of a run; names that OMPL's own benchmarks have mean the same here. Times in s, memory in MB."""

PROGRESS = (("runid", "INTEGER"), ("time", "REAL"))

MEASUREMENTS = (("best_cost", "REAL"), ("iterations", "INTEGER"))


def _table(name: str, columns: tuple[tuple[str, str], ...], *constraints: str) -> str:
    words = [f"{column} {kind}" for column, kind in columns]
    return f"CREATE TABLE IF NOT EXISTS {name} ({', '.join([*words, *constraints])});"


TABLES = "\n".join(
    [
        _table("experiments", EXPERIMENTS + PARAMETERS),
        _table("plannerConfigs", PLANNER_CONFIGS),
        _table("enums", ENUMS, "PRIMARY KEY (name, value)"),
        _table(
            "runs",
            RUNS + ATTRIBUTES,
            "FOREIGN KEY (experimentid) REFERENCES experiments(id) ON DELETE CASCADE",
            "FOREIGN KEY (plannerid) REFERENCES plannerConfigs(id) ON DELETE CASCADE",
        ),
        _table(
            "progress",
            PROGRESS + MEASUREMENTS,
            "PRIMARY KEY (runid, time)",
            "FOREIGN KEY (runid) REFERENCES runs(id) ON DELETE CASCADE",
        ),
    ]
)

_ALL = "FROM plannerConfigs p JOIN runs r ON p.id = r.plannerid JOIN experiments e ON e.id = r.experimentid"
_MEANS = "AVG(r.solved) AS avg_solved, AVG(r.time) AS avg_total_time"

VIEWS = f"""
CREATE VIEW IF NOT EXISTS bestPlannerConfigsPerExperiment AS
SELECT plannerid, experimentid, MIN(avg_solved) AS avg_solved, avg_total_time FROM (
  SELECT r.plannerid, p.name AS plannerName, r.experimentid, {_MEANS} {_ALL} GROUP BY r.plannerid, r.experimentid
) GROUP BY plannerName, experimentid ORDER BY avg_solved DESC, avg_total_time ASC;
CREATE VIEW IF NOT EXISTS bestPlannerConfigs AS
SELECT plannerid, MIN(avg_solved) AS avg_solved, avg_total_time FROM (
  SELECT r.plannerid, p.name AS plannerName, {_MEANS} {_ALL} GROUP BY r.plannerid
) GROUP BY plannerName ORDER BY avg_solved DESC, avg_total_time ASC;
"""
"""The views that OMPL's reader adds."""

OWN = """
CREATE TABLE IF NOT EXISTS pushplan_suite (
  id INTEGER PRIMARY KEY CHECK (id = 1), format INTEGER, name TEXT, source BLOB, version TEXT, versions TEXT,
  machine TEXT, started TEXT, seconds REAL);
CREATE TABLE IF NOT EXISTS pushplan_problems (
  experimentid INTEGER PRIMARY KEY REFERENCES experiments(id) ON DELETE CASCADE,
  name TEXT, hash TEXT, version TEXT, UNIQUE (hash, version));
CREATE TABLE IF NOT EXISTS pushplan_plan (
  key TEXT PRIMARY KEY, number INTEGER, problem TEXT, planner TEXT, stable_set TEXT, seed INTEGER);
CREATE TABLE IF NOT EXISTS pushplan_runs (
  runid INTEGER PRIMARY KEY REFERENCES runs(id) ON DELETE CASCADE,
  key TEXT UNIQUE NOT NULL, outcome TEXT, message TEXT, arcs TEXT, log TEXT, host TEXT, ended TEXT);
CREATE TABLE IF NOT EXISTS pushplan_progress (
  runid INTEGER REFERENCES runs(id) ON DELETE CASCADE, time REAL, best_cost REAL, iterations INTEGER,
  PRIMARY KEY (runid, time));
"""
"""The suite that was asked for last, its problems and the runs it consists of, what else is known of each run, and
its improvements (`progress` has the best costs at regular times)."""

STATUS_ROWS = [("status", value, status) for value, status in enumerate(STATUSES)]
