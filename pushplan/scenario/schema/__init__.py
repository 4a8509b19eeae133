"""The scenario file as a typed model, and what is wrong in one as located sentences."""
