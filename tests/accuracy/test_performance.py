"""AP and RP of repeated poses, against their definitions and what a scatter of known size must give."""

import numpy as np
import pytest

from planner.accuracy.validation import pose_performance
from planner.runs.run import Readings, Run, Samples
from planner.service.certificate_content import RMS_OF_REPEATABILITY

POSES, VISITS, SIGMA = 5, 400, 2e-5


def made(visits):
    """A tracker's run of poses with known offsets and an isotropic scatter."""
    rng = np.random.default_rng(4)
    pose = np.repeat(np.arange(POSES), visits)
    offset = rng.normal(0.0, 5e-4, (POSES, 3))
    scatter = rng.normal(0.0, SIGMA, (len(pose), 3))
    place = rng.normal(0.0, 1.0, (POSES, 3))
    samples = Samples(np.zeros((len(pose), 6)), np.zeros(len(pose), dtype=int), pose=pose)
    return Run("v", samples, Readings(position=place[pose] + offset[pose] + scatter)), offset[pose] + scatter, offset


def test_they_are_those_of_the_scatter_and_the_offsets_put_in():
    run, error, offset = made(VISITS)
    found = pose_performance(run, error)
    assert found.accuracy == pytest.approx(np.linalg.norm(offset, axis=1), abs=4e-6)
    assert found.repeatability.mean() == pytest.approx(SIGMA * 3**0.5 / RMS_OF_REPEATABILITY, rel=0.03)
    assert "standard asks" not in found.text()
    assert found.section()["visits"] == [VISITS, VISITS]


def test_few_visits_are_said_and_single_ones_give_nothing():
    run, error, _ = made(4)
    assert "the standard asks for 5 poses of 30 visits" in pose_performance(run, error).text()
    assert pose_performance(*made(1)[:2]) is None
