"""Who may ask what: names of the host, other sites, tokens, sizes, limits of jobs."""

import pytest

from planner.common.errors import InputError
from planner.service.serving import add_guard
from planner.service.settings import JobLimits, ServiceSettings
from tests.service.conftest import AT_HOME, client_of, ended, upload

TOKEN = "a token of twenty-three"


@pytest.fixture(scope="module")
def locked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("locked")
    with client_of(folder, host="0.0.0.0", token=TOKEN, most_upload=1000, limits=JobLimits(90 << 20, 60.0)) as made:
        yield made


def test_beyond_this_machine_a_token_is_demanded(tmp_path):
    with pytest.raises(InputError, match="EDBB_TOKEN"):
        add_guard(ServiceSettings(folder=tmp_path, host="0.0.0.0"))
    with pytest.raises(InputError, match="at least 16"):
        ServiceSettings(folder=tmp_path, token="short")
    assert TOKEN not in repr(ServiceSettings(folder=tmp_path, token=TOKEN))


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 401),
        ({"authorization": "Bearer wrong"}, 401),
        ({"cookie": "edbb_session=wrong"}, 401),
        ({"authorization": f"Bearer {TOKEN}"}, 200),
        ({"authorization": f"Bearer {TOKEN}", "origin": "http://evil.example"}, 403),
        ({"authorization": f"Bearer {TOKEN}", "origin": AT_HOME}, 200),
        ({"authorization": f"Bearer {TOKEN}", "host": "evil.example"}, 421),
        ({"authorization": f"Bearer {TOKEN}", "host": "192.168.1.4:8017"}, 200),
    ],
)
def test_who_may_ask(locked, headers, status):
    answer = locked.get("/api/robots", headers=headers)
    assert answer.status_code == status
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert TOKEN not in answer.text


def test_a_browser_logs_in_and_keeps_no_token(locked):
    assert locked.get("/", follow_redirects=False).headers["location"] == "/login"
    wrong = locked.post("/login", data={"token": "wrong"}, follow_redirects=False)
    assert (wrong.status_code, wrong.headers.get("set-cookie")) == (401, None)
    right = locked.post("/login", data={"token": TOKEN}, follow_redirects=False)
    cookie = right.headers["set-cookie"]
    assert right.status_code == 303
    assert "HttpOnly" in cookie
    assert "SameSite=lax" in cookie
    assert TOKEN not in cookie
    assert locked.get("/").status_code == 200
    locked.cookies.clear()


@pytest.mark.parametrize("chunked", [False, True])
def test_more_than_is_taken_is_refused(locked, chunked):
    content = iter([b"x" * 600, b"x" * 600]) if chunked else b"x" * 1200
    headers = {"authorization": f"Bearer {TOKEN}"}
    answer = locked.post("/api/runs", params={"name": "run.csv"}, content=content, headers=headers)
    assert answer.status_code == 413, answer.text


@pytest.mark.slow
def test_a_job_that_needs_too_much_memory_is_stopped(locked):
    locked.headers["authorization"] = f"Bearer {TOKEN}"
    job = ended(locked, locked.post("/api/cell-checks", json={"cell": "ur10/edbb"}))
    assert job["state"] == "failed"
    assert "more than 0.0879 GB" in job["problem"]["detail"] or "more memory" in job["problem"]["detail"]


def test_a_job_that_takes_too_long_is_stopped(tmp_path):
    with client_of(tmp_path, limits=JobLimits(3 << 30, 0.2)) as client:
        upload(client, "files", b"x", "a.txt")
        job = ended(client, client.post("/api/cell-checks", json={"cell": "ur10/edbb"}))
        assert job["problem"]["title"] == "Too much time"
