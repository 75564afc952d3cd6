"""Effects of loads: what yields under weight, payload and the pull of the bar."""

from tests.simulation.generator.kinds import Kind


def _joint(scene, e):
    return {f"theta{e.joint}": e.size * scene.moments(f"theta{e.joint}")}


def _payload_joint(scene, e):
    slot = f"theta{e.joint}"
    return {slot: e.size * scene.payload * scene.moments(slot, "payload")}


def _bending(scene, e):
    slot = f"beta{e.joint}"
    return {slot: e.size * scene.moments(slot)}


def _twist(scene, e):
    slot = f"alpha{e.joint}"
    return {slot: e.size * scene.moments(slot)}


def _floor(scene, e):
    return {slot: e.size * scene.moments(slot) for slot in ("base_rx", "base_ry")}


def _floor_xy(scene, e):
    soft = {"base_rx": e["ratio"], "base_ry": 1.0}
    return {slot: e.size * k * scene.moments(slot) for slot, k in soft.items()}


def _tool(scene, e):
    return {slot: e.size * scene.moments(slot) for slot in ("tool_rx", "tool_ry")}


def _wrong_payload(scene, e):
    yields = {f"theta{j}": e[f"compliance{j}"] for j in (2, 3)}
    return {slot: e.size * c * scene.moments(slot, "payload") for slot, c in yields.items()}


def _soft_joints(rng, arm, joint):
    return {f"compliance{j}": rng.uniform(0.5, 2.0) * 1e-3 / arm.reference_torque() for j in (2, 3)}


KINDS = (
    Kind("joint-compliance", "rad/Nm", (1e-4, 3e-3), _joint, joints="loaded", right=("payload-compliance",)),
    Kind(
        "payload-compliance", "rad/Nm", (1e-4, 3e-3), _payload_joint, joints="loaded", logs=("payload",),
        motion=("static",), right=("joint-compliance",),
    ),
    Kind(
        "force-compliance", "rad/Nm", (1e-4, 3e-3), _joint, joints="all", logs=("force",), gauges=("edbb",),
        motion=("static",), right=("joint-compliance",),
    ),
    Kind("link-bending", "rad/Nm", (1e-4, 3e-3), _bending, joints="loaded"),
    Kind("soft-base", "rad/Nm", (1e-5, 2e-3), _floor),
    Kind("tool-compliance", "rad/Nm", (2e-3, 0.5), _tool, right=("flange-compliance",)),
    Kind(
        "wrong-payload", "kg", (0.02, 0.5), _wrong_payload,
        inner=_soft_joints,
        right_anywhere=("joint-compliance", "payload-compliance", "payload-mass"),
    ),
    Kind(
        "soft-floor-xy", "rad/Nm", (1e-5, 2e-3), _floor_xy, in_catalogue=False,
        inner=lambda rng, arm, joint: {"ratio": rng.choice([0.2, 0.4, 2.5, 5.0])},
        right=("soft-base",), right_anywhere=("soft-base",),
    ),
    Kind(
        "link-twist", "rad/Nm", (1e-4, 3e-3), _twist, joints="loaded", in_catalogue=False,
        right=("link-bending", "link-compliance"),
    ),
)  # fmt: skip
