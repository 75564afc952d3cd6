import numpy as np
import pytest

from planner.motion.timing.curve import Limits
from planner.motion.timing.trajectory import check_limits, plan_trajectory
from tests.motion.timing.arm import nj130, random_arm, random_tour
from tests.motion.timing.bound import KEPT, acceleration_bound, largest_share, speed_bound

SEEDS = range(24)
H = 1e-3  # [s] of the finite differences


def drive(arm, tour):
    limits = Limits(arm.speed, arm.acceleration, arm.jerk)
    return plan_trajectory(**tour, tool_position=arm.position, tool_jacobian=arm.jacobian, limits=limits), limits


@pytest.fixture(scope="module")
def driven():
    made = {}

    def get(seed):
        if seed not in made:
            rng = np.random.default_rng(seed)
            arm = random_arm(rng)
            tour = random_tour(rng, len(arm.a))
            made[seed] = (arm, tour, *drive(arm, tour))
        return made[seed]

    return get


def measuring_tour(rng, m, reach=1.0):
    centre = np.array([0.3, 0.5, -0.3, 0.2, 1.2, 0.0])
    q = centre + reach * rng.uniform(-1, 1, (m, 6)) * np.array([0.6, 0.4, 0.4, 1.2, 0.8, 1.5])
    return {"path_q": q, "stop": np.zeros(m, dtype=bool), "blend_m": 0.01, "tool_speed": 1 / 60, "dwell": 0.0}


@pytest.mark.parametrize("seed", SEEDS)
def test_finite_differences_of_the_sampled_angles_keep_every_limit(driven, seed):
    # the k-th difference over h^k is a mean of the k-th derivative, so it can never exceed a limit that is kept
    arm, _, trajectory, _ = driven(seed)
    rng = np.random.default_rng(seed)
    t = rng.uniform(-2 * H, trajectory.duration_s + 2 * H, 1500)
    t = np.concatenate([t, (trajectory.phases.t[:500, None] + np.array([-1.5, -0.5, 0.0]) * H).ravel()])
    q = np.stack([trajectory.at(t + k * H).q for k in range(4)])
    noise = 1e-15 * np.abs(q).max()
    for order, limit in ((1, arm.speed), (2, arm.acceleration), (3, arm.jerk)):
        use = np.abs(np.diff(q, order, axis=0)).max(axis=(0, 1)) / H**order / limit
        assert use.max() <= 1.0 + 1e-6 + 16 * noise / H**order / limit.min()
    x = np.stack([arm.position(row) for row in q])
    speed = np.linalg.norm(np.diff(x, axis=0), axis=2) / H
    leg = [np.clip(np.searchsorted(trajectory.waypoint_time, t + k * H) - 1, 0, len(q[0]) - 1) for k in range(4)]
    limit = np.stack([trajectory.tool_speed_limit[np.minimum(k, len(trajectory.tool_speed_limit) - 1)] for k in leg])
    assert (speed / np.maximum(limit[:-1], limit[1:])).max() <= 1.0 + 1e-6


@pytest.mark.parametrize("seed", SEEDS)
def test_analytic_rates_agree_with_finite_differences(driven, seed):
    arm, _, trajectory, _ = driven(seed)
    rng = np.random.default_rng(seed)
    start = trajectory.phases.t
    length = np.diff(np.append(start, trajectory.duration_s))
    k = rng.choice(np.flatnonzero(length > 0.01 * length.max()), 60)
    h = 1e-4 * np.minimum(length[k], 0.1)
    t = start[k] + length[k] * rng.uniform(0.1, 0.9, len(k))
    before, here, after = (trajectory.at(t + sign * h) for sign in (-1.0, 0.0, 1.0))
    for low, high, rate, limit in (
        (before.q, after.q, here.dq, arm.speed),
        (before.dq, after.dq, here.ddq, arm.acceleration),
        (before.ddq, after.ddq, here.dddq, arm.jerk),
    ):
        slope = (high - low) / (2.0 * h)[:, None]
        assert (np.abs(slope - rate) / limit).max() <= 1e-4


@pytest.mark.parametrize("seed", SEEDS)
def test_own_report_finds_the_limits_kept_and_nearly_used(driven, seed):
    _, _, trajectory, limits = driven(seed)
    report = check_limits(trajectory, limits, max(trajectory.duration_s / 1000, 1e-3))
    assert 0.9 <= largest_share(report) <= KEPT


@pytest.mark.parametrize("seed", SEEDS)
def test_stops_are_met_exactly_and_at_rest_for_their_dwell(driven, seed):
    _, tour, trajectory, _ = driven(seed)
    rest = np.flatnonzero(trajectory.stop)
    assert set(np.flatnonzero(tour["stop"])) <= set(rest)
    for part in (0.0, 0.5, 1.0):
        state = trajectory.at(trajectory.waypoint_time[rest] + part * trajectory.dwell[rest])
        assert np.abs(state.q - tour["path_q"][rest]).max() <= 2e-8
        assert np.abs(state.dq).max() <= 1e-6
    distinct = np.linalg.norm(np.diff(tour["path_q"], axis=0), axis=1).min() > 1e-7
    if distinct:
        assert np.abs(trajectory.at(trajectory.waypoint_time[rest]).q - tour["path_q"][rest]).max() <= 1e-12


@pytest.mark.parametrize("seed", SEEDS)
def test_times_add_up_and_the_path_is_never_driven_backwards(driven, seed):
    _, tour, trajectory, _ = driven(seed)
    assert trajectory.waypoint_time[0] == 0.0
    assert trajectory.leg_duration.sum() + trajectory.dwell.sum() == pytest.approx(trajectory.duration_s, rel=1e-9)
    state = trajectory.sample(max(trajectory.duration_s / 3000, 1e-4))
    assert state.t[-1] == trajectory.duration_s
    assert np.diff(state.s).min() >= -1e-9 * trajectory.curve.length / len(state.s)
    assert trajectory.phases.speed.min() >= 0.0
    end = trajectory.at([-1.0, trajectory.duration_s + 1.0])
    assert np.abs(end.q - tour["path_q"][[0, -1]]).max() <= 2e-8
    assert np.all(end.dq == 0.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_blended_points_are_passed_without_a_stop_and_at_the_time_of_closest_passage(driven, seed):
    _, tour, trajectory, _ = driven(seed)
    for i in np.flatnonzero(~trajectory.stop):
        t = trajectory.waypoint_time[i]
        assert np.abs(trajectory.at(t).dq).max() > 0.0
        around = np.linspace(trajectory.waypoint_time[i - 1], trajectory.waypoint_time[i + 1], 400)
        away = np.linalg.norm(trajectory.at(around).q - tour["path_q"][i], axis=1).min()
        assert np.linalg.norm(trajectory.at(t).q[0] - tour["path_q"][i]) <= away + 2e-8


@pytest.mark.parametrize("seed", SEEDS)
def test_time_is_never_less_than_any_motion_needs(driven, seed):
    arm, _, trajectory, _ = driven(seed)
    bound = speed_bound(trajectory, arm, 60)
    assert trajectory.leg_duration.sum() >= bound * (1.0 - 1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_a_measuring_tour_is_within_two_percent_of_its_speed_limit(seed):
    arm = nj130()
    tour = measuring_tour(np.random.default_rng(seed), 35)
    trajectory, limits = drive(arm, tour)
    stopping, _ = drive(arm, tour | {"stop": np.ones(35, dtype=bool)})
    assert largest_share(check_limits(trajectory, limits, 0.5)) <= KEPT
    assert trajectory.measuring_s == pytest.approx(trajectory.duration_s)
    assert trajectory.duration_s <= 1.02 * speed_bound(trajectory, arm)
    assert trajectory.duration_s < stopping.duration_s


@pytest.mark.parametrize("seed", range(4))
def test_a_dense_measuring_tour_takes_a_tenth_less_than_stopping(seed):
    arm = nj130()
    tour = measuring_tour(np.random.default_rng(seed), 60, reach=0.03)
    trajectory, _ = drive(arm, tour)
    stopping, _ = drive(arm, tour | {"stop": np.ones(60, dtype=bool)})
    assert trajectory.duration_s <= 1.04 * speed_bound(trajectory, arm)
    assert trajectory.duration_s <= 0.9 * stopping.duration_s


@pytest.mark.parametrize("seed", range(3))
def test_at_full_speed_the_time_is_near_that_without_a_limit_of_jerk(seed):
    arm = nj130()
    tour = measuring_tour(np.random.default_rng(seed), 12) | {"tool_speed": np.inf}
    trajectory, _ = drive(arm, tour)
    bound = acceleration_bound(trajectory, arm)
    assert bound <= trajectory.duration_s <= 1.5 * bound
    assert trajectory.measuring_s == 0.0


def test_points_on_a_straight_line_cost_no_time():
    arm = nj130()
    ends = np.array([[0.0] * 6, [1.0, 0.5, -0.4, 0.8, 0.3, 1.2]])
    between = ends[0] + np.linspace(0.0, 1.0, 6)[:, None] * (ends[1] - ends[0])
    ask = {"blend_m": 0.01, "tool_speed": np.inf, "dwell": 0.0}
    whole, _ = drive(arm, ask | {"path_q": ends, "stop": [True, True]})
    parts, _ = drive(arm, ask | {"path_q": between, "stop": [True, *[False] * 4, True]})
    assert parts.duration_s <= 1.05 * whole.duration_s
    assert not parts.stop[1:-1].any()


def test_a_single_leg_takes_what_ruckig_says_for_its_slowest_joint():
    import ruckig

    arm = nj130()
    q = np.array([[0.0] * 6, [0.9, 0.1, 0.2, -0.3, 0.1, 0.2]])
    mine, _ = drive(arm, {"path_q": q, "stop": [True, True], "blend_m": 0.01, "tool_speed": np.inf, "dwell": 0.0})
    move, answer = ruckig.InputParameter(1), ruckig.Trajectory(1)
    move.target_position = [0.9]
    move.max_velocity, move.max_acceleration, move.max_jerk = [arm.speed[0]], [arm.acceleration[0]], [arm.jerk[0]]
    ruckig.Ruckig(1).calculate(move, answer)
    assert mine.duration_s == pytest.approx(answer.duration, rel=1e-3)


def test_a_tour_that_never_moves_only_dwells():
    arm = nj130()
    q = np.zeros((3, 6))
    still, limits = drive(
        arm, {"path_q": q, "stop": [True] * 3, "blend_m": 0.01, "tool_speed": 0.1, "dwell": [1, 2, 3]}
    )
    assert still.duration_s == 6.0
    assert still.waypoint_time.tolist() == [0.0, 1.0, 3.0]
    assert np.array_equal(still.sample(0.5).q, np.zeros((13, 6)))
    assert largest_share(check_limits(still, limits)) == 0.0


def test_repeated_stops_wait_one_after_another():
    arm = nj130()
    q = np.array([[0.0] * 6, [0.2] * 6, [0.2] * 6, [0.1] * 6])
    tour = {"path_q": q, "stop": [True] * 4, "blend_m": 0.01, "tool_speed": 0.1, "dwell": [0.0, 0.5, 0.25, 1.0]}
    trajectory, _ = drive(arm, tour)
    assert trajectory.waypoint_time[2] == trajectory.waypoint_time[1] + 0.5
    assert trajectory.leg_duration[1] == 0.0
    assert trajectory.duration_s == pytest.approx(trajectory.waypoint_time[3] + 1.0)
    assert trajectory.measuring_s == pytest.approx(trajectory.duration_s)
