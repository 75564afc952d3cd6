"""Arms as they truly are, made without a look at the planner's code, and a table that judges what it states of them.

``chain`` has kinematics and gravity, ``causes`` what calibration reports name, ``foreign`` what no catalogue lists;
``arm`` draws an arm by its seed, ``runs`` measures it (a bar at rest or driven, a tracker), ``judge`` has it identified
by the command and compares the released robot with the true one, ``table`` sums up many arms::

    python -m tests.independent_arms --gauge bar --causes 0,1,2,3,6 --foreign 1 --arms 20 -o table.csv

Whether a released robot is worse than geometry alone is told by `--product-geometry`, which has the geometry of the
same fit: two fits of geometry that are as good as each other (``fit`` is least squares with one noise, the product
weighs by posture and learns its priors) differ by a third on clean arms, either way.

Nothing here may be taken from the planner: kinematics, loads, shapes and sizes of the causes are an engineer's own, and
the product is used by its commands and files alone.
"""
