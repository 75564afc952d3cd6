"""What the catalogue calls the generator's effects."""

JOINT = {
    "joint-compliance": "joint compliance",
    "payload-compliance": "payload compliance",
    "force-compliance": "joint compliance",
    "encoder-once": "encoder once a turn",
    "encoder-twice": "encoder twice a turn",
    "reducer-ripple": "gear ripple",
    "strain-wave": "strain-wave error",
    "reduction-ratio": "reduction ratio",
    "backlash-speed": "backlash",
    "backlash-approach": "backlash",
    "backlash-torque": "backlash by load",
    "servo-lag": "servo lag",
    "thermal-joint": "thermal drift",
    "joint-drift": "drift",
    "warm-up": "warm-up",
    "hysteresis": "hysteresis",
    "warm-up-two": "warm-up",
    "sawtooth": "gear ripple",
}
ELSEWHERE = {
    "soft-base": ("soft base", "base"),
    "soft-floor-xy": ("soft base", "base"),
    "tool-compliance": ("tool compliance", "tool"),
    "wrong-payload": ("payload mass", "payload"),
    "unsettled": ("unsettled angle", "all joints"),
    "thermal-links": ("link growth", "arm"),
    "base-drift": ("drift", "base"),
    "gauge-scale": ("gauge scale", "gauge"),
    "gauge-growth": ("gauge growth", "gauge"),
    "gauge-nonlinearity": ("gauge nonlinearity", "gauge"),
    "gauge-lag": ("gauge lag", "gauge"),
    "gauge-filter": ("gauge lag", "gauge"),
    "gauge-sag": ("gauge sag", "gauge"),
    "gauge-interpolation": ("scale interpolation", "gauge"),
    "ball-centre": ("ball centre", "ball at the fixture"),
    "session-step": ("session step", "gauge"),
}
INNER = ("frequency", "period", "tau", "slow", "width")


def named(effect):
    """The kind and place under which the catalogue has an effect of the generator; ``None`` where it has no name."""
    if effect.kind in JOINT:
        return JOINT[effect.kind], f"joint {effect.joint}"
    if effect.kind == "coupling":
        return "coupling", f"joint {effect.joint} by joint {int(effect['by'])}"
    if effect.kind == "wobble":
        often = {1: "once", 2: "twice", 3: "three times"}[int(effect["turns"])]
        return f"axis wobble {often} a turn", f"joint {effect.joint}"
    if effect.kind in ("link-bending", "link-twist"):
        return "link bending", f"link {effect.joint}"
    return ELSEWHERE.get(effect.kind)


def inner(effect):
    """The number inside the effect, where it has one."""
    return next((value for name, value in effect.inner if name in INNER), None)


def joint_of(on):
    """Number of the joint or link (from 1) at which an entry sits; 0 where it sits at none."""
    word, *rest = on.split()
    return int(rest[0]) if word in ("joint", "link") else 0
