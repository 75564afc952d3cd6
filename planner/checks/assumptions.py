"""What decides a check besides cell, baseline and run: probabilities and thresholds with their reasons."""

FALSE_ALARM = 0.01  # probability of an alarm on a robot that is as it was, of all tests together
POWER = 0.9  # probability with which a change of the stated size is found
UNSEEN_SHARE = 1e-6  # of a change's largest effect on the readings: a direction below shows in none
FEWEST_READINGS = 4  # below, nothing is judged
