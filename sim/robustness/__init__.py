"""What a plan can bear: how far a number of the chain may be off before the first contact is lost on the way."""
