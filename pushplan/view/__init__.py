"""Interactive window: a scenario in a browser, where dragging its poses updates the plan."""
