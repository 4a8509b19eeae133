"""The slip simulator: bodies on a floor whose contacts stick, slide, rotate about an end, open and close."""
