"""The slip step: bodies on a floor whose contacts stick, slide, roll off an end, open and close again."""
