"""What decides a check besides cell, baseline and run: probabilities and thresholds with their reasons."""

FALSE_ALARM = 0.01  # probability of an alarm on a robot that is as it was, of all tests together
POWER = 0.9  # probability with which a change of the stated size is found
THRESHOLD_SIGMAS = 2.0  # of the draws' own scatter, by which the threshold keeps the false alarms below what is stated
UNSEEN_SHARE = 1e-6  # of a change's largest effect on the readings: a direction below shows in none
SHOWING_SHARE = 0.9  # of the ways that many parameters may change: what so many of them show is stated
FEWEST_READINGS = 4  # below, nothing is judged
CHANGE_SIGMAS = 2.0  # above its estimate a change may still be: so far it must stay below the limit
