"""Where a stable set ends: its exact boundary on the sphere of twists."""
