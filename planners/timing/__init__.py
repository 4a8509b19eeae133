"""Timing of paths: limits of pusher and contacts, and jerk-limited profiles."""

from pushplan.util.interruption import import_uninterrupted

import_uninterrupted("ruckig")
