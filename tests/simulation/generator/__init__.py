"""Makes measured runs of arms whose truth is known, from plain numpy alone: the world that judges the planner.

Nothing here may import the planner. Arms are read as data from their TOML files; forward kinematics, loads, gauges,
noise and effects are written apart. Start at ``runs`` (what is measured), ``truth`` (what is wrong with the arm),
``catalogue`` (the kinds of effects), ``draw`` (random truths) and ``oracle`` (what the best possible fit leaves).
"""
