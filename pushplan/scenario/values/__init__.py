"""Numbers with units and intervals, as files write them."""
