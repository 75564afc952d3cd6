"""Arms as they truly are, made without a look at the planner's code, and a table that judges what it states of them."""
