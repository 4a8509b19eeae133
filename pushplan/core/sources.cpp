// The digest of the sources that the core was built from; `building.py` defines it.
#ifndef PUSHPLAN_SOURCES
#define PUSHPLAN_SOURCES "unknown"
#endif

namespace pushplan {
extern const char *const SOURCES;
const char *const SOURCES = PUSHPLAN_SOURCES;
} // namespace pushplan
