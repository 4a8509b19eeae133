"""What everything else may use: array types, shared words and names, texts for terminals, clocks, Ctrl-C."""
