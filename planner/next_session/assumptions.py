"""What a further session begins with."""

NEXT_SESSION_POSES = 20  # where nobody gives a number: about ten minutes
