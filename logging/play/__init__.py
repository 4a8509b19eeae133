"""A recorded run played as time goes by: in a terminal, or to viewers that connect."""
