"""Every file that a command writes goes through here: looked at first, whole or not there, nothing else destroyed."""
