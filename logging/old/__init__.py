"""Logs as they were before `plans.plan.Plan`; each goes when who uses it has moved to the module on the right.

- `writer.RunLogWriter`, `recording.Recording`: `logging.writer`, `logging.recording` (`RunLogWriter.follow` has no
  successor: a rearrangement is one plan);
- `reader.read_run`, `read_runs`, `messages.recorded.RecordedRun`: `logging.reader.load_run`, `logging.recorded`;
- `verify`, `verify_file`, `check`, `plan_again`, `several_again`, `errands`: `verification.verify_log`;
- `joined`, `cut_off`, `trial_log`, `courses`: nothing; executions of any kind go through `RunLogWriter.execution`,
  `samples` and `closed_loop`, measurements are `RecordedRun.feedback.measured`;
- `page`, `film`, `bag`, `tables`, `layout`, `recover`: the same names in `logging`;
- `view.scene`, `view.window`, `view.contacts`: `logging.scene`, `logging.shown`, `logging.contacts`;
- `view.summary`: its lines belong to the command `replay`.
"""
