"""Who may do what: roles, log in and out, tokens, a proxy's log-in, guessing, the log of deeds, quotas."""

import io
import json
import re
import sys
import time
from types import SimpleNamespace

import pytest
from argon2 import PasswordHasher, extract_parameters
from fastapi.testclient import TestClient

from planner.common.errors import InputError
from planner.service import callers
from planner.service import people as people_module
from planner.service.access import RULES, check_rules, routes_of
from planner.service.callers import PATIENCE, GuessLimit, original_address, sender_of
from planner.service.database import Database
from planner.service.job_record import JobCommand, JobOutput
from planner.service.people import IDLE_S, SESSION_S, PeopleStore
from planner.service.serving import add_guard, build_app, build_context
from planner.service.settings import ProxySettings, Quota, Role
from tests.command import edbb
from tests.service.conftest import AT_HOME, client_of, settings, upload

ROLES = {"luis": Role.LOOK, "wanda": Role.WORK, "ada": Role.ADMINISTER}
PASSWORD = "correct horse battery"
SOME_JOB, SOME_FILE = "0" * 24, "0" * 64
PLACES = {
    "id": SOME_JOB,
    "sha256": SOME_FILE,
    "serial": "R1",
    "robot": "ur10",
    "cell": "edbb",
    "name": "x",
    "number": "R1-C01",
}


def people_of(folder):
    return PeopleStore(Database(folder / "jobs.sqlite3"))


def add_all(folder):
    people = people_of(folder)
    for name in ("ada", "wanda", "luis"):
        people.add(name, ROLES[name], PASSWORD)
    return people


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """A service that runs no jobs, with a person of each role and a token of each."""
    folder = tmp_path_factory.mktemp("people")
    people = add_all(folder)
    tokens = {name: people.make_token(name, "test") for name in ROLES}
    with client_of(folder, workers=0, beside=0) as client:
        client.tokens, client.people = tokens, people
        yield client


def ask_as(client, name, method, path, **content):
    headers = {"authorization": f"Bearer {client.tokens[name]}"} | content.pop("headers", {})
    return client.request(method, path, headers=headers, follow_redirects=False, **content)


def log_in(client, name, password=PASSWORD, **query):
    return client.post("/login", params=query, data={"name": name, "password": password}, follow_redirects=False)


@pytest.mark.slow
def test_every_route_of_the_document_has_a_rule(tmp_path):
    """Every operation of the OpenAPI document too; a route that nobody gave a rule ends the start."""
    app = build_app(build_context(settings(tmp_path)))
    described = {f"{m.upper()} {path}" for path, found in app.openapi()["paths"].items() for m in found}
    assert described <= {re.sub(r":path\}", "}", rule) for rule in RULES}
    assert set(routes_of(app.routes)) == set(RULES)
    app.add_api_route("/api/forgotten", lambda: None, methods=["POST"])
    with pytest.raises(AssertionError, match="POST /api/forgotten"):
        check_rules(app)


@pytest.mark.parametrize("rule", sorted(r for r in RULES if not r.startswith("GET /api/events")))
def test_each_role_at_each_route(plant, rule):
    """Without a name nothing; below the role 403; from the role on anything but a refusal of the person."""
    method, path = rule.split()
    path = re.sub(
        r"\{(\w+)(:path)?\}",
        lambda m: SOME_FILE if path in ("/api/files/{id}", "/api/cells/{id}") else PLACES[m[1]],
        path.replace("entries/{number}", "entries/1"),
    )
    needed = RULES[rule].role
    content = {"json": {}} if method in ("POST", "PATCH", "PUT") else {}
    nobody = plant.request(method, path, follow_redirects=False, **content)
    if needed is None:
        assert nobody.status_code == 401 if rule == "POST /login" else nobody.status_code in (200, 303)
        return
    assert nobody.status_code in (401, 303), nobody.text
    for name, role in ROLES.items():
        answer = ask_as(plant, name, method, path, **content)
        assert (answer.status_code == 403) == (not role.covers(needed)), (name, answer.text)
        assert answer.status_code != 401
        assert answer.status_code < 500


def test_events_take_a_look(plant):
    assert plant.get("/api/events?wait=false").status_code == 401
    assert ask_as(plant, "luis", "GET", "/api/events?wait=false").status_code == 200


@pytest.mark.slow
def test_one_alone_on_this_machine_needs_no_name_until_somebody_has_one(tmp_path):
    with client_of(tmp_path, workers=0, beside=0) as client:
        assert client.get("/api/deeds").status_code == 200
        assert "Nobody has to log in" in client.get("/login").text
        people_of(tmp_path).add("ada", Role.ADMINISTER, PASSWORD)
        assert client.get("/api/robots").status_code == 401
        assert client.get("/", follow_redirects=False).headers["location"] == "/login"


def test_log_in_leads_to_the_page_that_was_wanted_and_out_again(plant):
    assert plant.get("/jobs", follow_redirects=False).headers["location"] == "/login?next=/jobs"
    answer = log_in(plant, "wanda", next="/jobs")
    cookie = answer.headers["set-cookie"]
    assert (answer.status_code, answer.headers["location"]) == (303, "/jobs")
    assert all(word in cookie for word in ("HttpOnly", "SameSite=lax", "Max-Age=604800"))
    assert "Secure" not in cookie
    page = plant.get("/jobs").text
    assert "wanda" in page
    assert "/deeds" not in page, "only administrators read the log"
    plant.post("/logout", follow_redirects=False)
    assert plant.get("/api/robots").status_code == 401
    kept = re.search(r"edbb_session=([^;]+)", cookie)[1]
    assert plant.get("/api/robots", headers={"cookie": f"edbb_session={kept}"}).status_code == 401, "it has ended"
    typed, by_tls = {"name": "wanda", "password": PASSWORD}, {"x-forwarded-proto": "https"}
    behind = plant.post("/login", data=typed, headers=by_tls, follow_redirects=False)
    assert "Secure" in behind.headers["set-cookie"]
    plant.cookies.clear()


@pytest.mark.parametrize("away", ["//evil.example", "https://evil.example", "/\\evil.example", "/a\nb", "javascript:x"])
def test_log_in_leads_nowhere_else(plant, away):
    assert log_in(plant, "wanda", next=away).headers["location"] == "/"
    plant.cookies.clear()


@pytest.mark.slow
def test_a_person_changes_the_own_password_and_other_browsers_log_in_again(tmp_path):
    add_all(tmp_path)
    with client_of(tmp_path, workers=0, beside=0) as client:
        assert log_in(client, "wanda").status_code == 303
        other = client.cookies["edbb_session"]
        client.cookies.clear()
        log_in(client, "wanda")
        assert 'href="/password"' in client.get("/jobs").text

        def change(old, new, again):
            typed = {"old": old, "new": new, "again": again}
            return client.post("/password", data=typed, follow_redirects=False)

        assert change(PASSWORD, "a longer one", "a longer ONE").status_code == 422
        assert "10 to 200" in change(PASSWORD, "short", "short").text
        assert change("wrong password", "a longer one", "a longer one").status_code == 401
        assert change(PASSWORD, "a longer one", "a longer one").headers["location"] == "/password?done=true"
        assert "It is changed" in client.get("/password?done=true").text
        client.cookies.clear()
        cookie = {"cookie": f"edbb_session={other}"}
        assert client.get("/jobs", headers=cookie, follow_redirects=False).status_code == 303
        assert log_in(client, "wanda").status_code == 401
        assert log_in(client, "wanda", "a longer one").status_code == 303
        for _ in range(PATIENCE.free_tries + 1):
            held = change("wrong password", "another one", "another one")
        assert held.status_code == 429


@pytest.mark.parametrize(("age", "idle"), [(SESSION_S + 1, 0.0), (IDLE_S + 1, IDLE_S + 1)])
def test_a_session_ends_by_age_and_by_idleness(tmp_path, monkeypatch, age, idle):
    people, now = add_all(tmp_path), time.time()
    cookie = people.log_in("wanda", PASSWORD)[1]
    step = IDLE_S / 2
    for k in range(int((age - idle) / step)):  # used all the time
        monkeypatch.setattr(time, "time", lambda k=k: now + k * step)
        assert people.by_session(cookie)[0] == "wanda"
        people.note_use(cookie)
    monkeypatch.setattr(time, "time", lambda: now + age)
    assert people.by_session(cookie) is None


def test_sessions_end_with_password_person_and_service_token(tmp_path):
    people = add_all(tmp_path)
    cookie = people.log_in("wanda", PASSWORD)[1]
    assert PeopleStore(people._db, "another token of the service").by_session(cookie) is None
    people.set_password("wanda", "another good password")
    assert people.by_session(cookie) is None
    assert people.log_in("wanda", PASSWORD) is None
    assert people.log_in("wanda", "another good password")[0].role is Role.WORK
    token, cookie = people.make_token("wanda", "cell 7"), people.log_in("wanda", "another good password")[1]
    people.remove("wanda")
    assert people.by_token(token) is people.by_session(cookie) is people.log_in("wanda", PASSWORD) is None


def test_nothing_that_is_kept_lets_anybody_in(tmp_path):
    people = add_all(tmp_path)
    token, cookie = people.make_token("ada", "x"), people.log_in("ada", PASSWORD)[1]
    kept = b"".join(p.read_bytes() for p in tmp_path.glob("jobs.sqlite3*"))
    for secret in (PASSWORD, token, cookie):
        assert secret.encode() not in kept
    assert b"$argon2id$" in kept


def test_names_and_passwords_are_held_to_what_is_allowed(tmp_path):
    people = people_of(tmp_path)
    with pytest.raises(InputError, match="the first person has to be an administrator"):
        people.add("wanda", Role.WORK, PASSWORD)
    people.add("ada", Role.ADMINISTER, PASSWORD)
    for name in ("", " ", "a\nb", "x" * 65, "a\u202eb"):
        with pytest.raises(InputError, match="1 to 64 letters"):
            people.add(name, Role.WORK, PASSWORD)
    for wrong in (lambda: people.remove("ada"), lambda: people.set_role("ada", Role.WORK)):
        with pytest.raises(InputError, match="last administrator"):
            wrong()
    with pytest.raises(InputError, match="10 to 200"):
        people.add("b", Role.WORK, "short")
    with pytest.raises(InputError, match="is known already"):
        people.add("ada", Role.WORK, PASSWORD)
    people.add("no", Role.WORK, None)
    assert people.log_in("no", "") is None


def test_whoever_guesses_waits_longer_each_time(monkeypatch):
    now, limit = [1000.0], GuessLimit()
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    there, who, waits = ("address", "10.0.0.1"), ("name", "ada"), []
    for _ in range(40):
        wait = limit.wait_s(there, who)
        waits.append(wait)
        now[0] += wait
        assert limit.wait_s(there, who) == 0
        limit.note_wrong(there, who)
    assert waits[: PATIENCE.free_tries] == [0.0] * PATIENCE.free_tries
    assert waits[PATIENCE.free_tries : PATIENCE.free_tries + 5] == [1, 2, 4, 8, 16]
    assert waits[-1] == 900
    assert limit.wait_s(("address", "10.0.0.2")) == 0
    assert limit.wait_s(("address", "10.0.0.2"), who) == PATIENCE.longest_name_s, "a name cannot be locked for long"
    limit.note_right(there, who)
    assert limit.wait_s(there, who) == 0
    for k in range(20_000):
        limit.note_wrong(("address", str(k)))
    assert len(limit._tries) <= 10_000
    assert sender_of("2001:db8::1") == sender_of("2001:db8::ffff") != sender_of("2001:db8:0:1::1")


@pytest.mark.slow
def test_guessing_is_limited_at_the_door(tmp_path, monkeypatch):
    token = add_all(tmp_path).make_token("luis", "cell 7")
    with client_of(tmp_path, workers=0, beside=0) as client:
        for _ in range(PATIENCE.free_tries):
            assert log_in(client, "ada", "wrong password").status_code == 401
        held = log_in(client, "ada")
        assert (held.status_code, held.headers["retry-after"]) == (429, "1")
        assert "Wait 1 s" in held.text
        now = time.monotonic()
        monkeypatch.setattr(callers, "time", SimpleNamespace(monotonic=lambda: now + 1.1))
        assert log_in(client, "ada").status_code == 303
        client.cookies.clear()
        for _ in range(PATIENCE.free_tries):
            assert client.get("/api/robots", headers={"authorization": "Bearer x"}).status_code == 401
        assert client.get("/api/robots", headers={"authorization": "Bearer x"}).status_code == 429
        right = client.get("/api/robots", headers={"authorization": f"Bearer {token}"})
        assert right.status_code == 200, "a program of the same address is not held off by another's mistake"
        for name in ("nobody", "x" * 900):
            assert log_in(client, name).status_code in (401, 429)


def test_somebody_who_is_not_there_takes_as_long(tmp_path, monkeypatch):
    """One password is checked in both cases, by a hash that costs the same."""
    people, costs, verify = add_all(tmp_path), [], PasswordHasher.verify

    def verify_noted(self, kept, password):
        costs.append(extract_parameters(kept))
        return verify(self, kept, password)

    monkeypatch.setattr(PasswordHasher, "verify", verify_noted)
    for name in ("ada", "nobody"):
        assert people.log_in(name, "wrong password") is None
    assert len(costs) == 2
    assert costs[0] == costs[1]


PROXY = ProxySettings(("10.1.0.0/24", "::1"), "X-Forwarded-User")


@pytest.mark.parametrize(
    ("peer", "headers", "role", "status", "name"),
    [
        ("10.1.0.7", {"x-forwarded-user": "wanda"}, None, 200, "wanda"),
        ("::1", {"x-forwarded-user": "wanda"}, None, 200, "wanda"),
        ("::ffff:10.1.0.7", {"x-forwarded-user": "wanda"}, None, 200, "wanda"),
        ("10.1.0.7", {"x-forwarded-user": "stranger"}, None, 403, None),
        ("10.1.0.7", {"x-forwarded-user": "stranger"}, Role.LOOK, 200, "stranger"),
        ("10.1.0.7", {"x-forwarded-user": " "}, Role.LOOK, 403, None),
        ("10.1.0.7", {}, Role.ADMINISTER, 401, None),
        ("10.2.0.7", {"x-forwarded-user": "wanda"}, Role.ADMINISTER, 401, None),
        ("127.0.0.1", {"x-forwarded-user": "ada"}, None, 401, None),
        # a foreign sender says that a trusted proxy was before it
        ("10.2.0.7", {"x-forwarded-user": "ada", "x-forwarded-for": "10.1.0.7"}, None, 401, None),
        ("10.1.0.7", {"remote-user": "ada"}, None, 401, None),
    ],
)
def test_a_proxy_is_believed_by_its_address_alone(tmp_path, peer, headers, role, status, name):
    add_all(tmp_path)
    proxy = ProxySettings(PROXY.networks, PROXY.user_header, role)
    app = add_guard(settings(tmp_path, workers=0, beside=0, proxy=proxy))
    with TestClient(app, base_url=AT_HOME, client=(peer, 50000)) as client:
        answer = client.get("/api/jobs", headers=headers)
        assert answer.status_code == status, answer.text
        page = client.get("/jobs", headers=headers, follow_redirects=False)
        assert page.status_code == (303 if status == 401 else status)
        assert name is None or name in page.text


def test_two_names_of_a_proxy_are_none(tmp_path):
    add_all(tmp_path)
    with TestClient(add_guard(settings(tmp_path, proxy=PROXY)), base_url=AT_HOME, client=("10.1.0.7", 5)) as client:
        twice = [("X-Forwarded-User", "luis"), ("X-Forwarded-User", "ada")]
        assert client.get("/api/jobs", headers=twice).status_code == 403


def test_where_a_request_began_is_said_by_trusted_proxies_alone():
    assert original_address("10.1.0.7", ["203.0.113.5"], PROXY) == "203.0.113.5"
    assert original_address("10.1.0.7", ["1.2.3.4, 203.0.113.5, 10.1.0.9"], PROXY) == "203.0.113.5"
    assert original_address("203.0.113.9", ["10.1.0.7"], PROXY) == "203.0.113.9"
    assert original_address("10.1.0.7", ["nonsense"], PROXY) == "10.1.0.7"
    for wrong in (("10.1.0.7/24",), ("proxy",)):
        with pytest.raises(InputError, match="--proxy"):
            ProxySettings(wrong)
    with pytest.raises(InputError, match="name the proxy"):
        ProxySettings((), "X-Forwarded-User")


def test_a_job_is_stopped_changed_and_deleted_by_its_person_or_an_administrator(plant):
    plant.people.add("willi", Role.WORK, None)
    plant.tokens["willi"] = plant.people.make_token("willi", "x")
    made = [ask_as(plant, "wanda", "POST", "/api/plans", json={"cell": "ur10/edbb", "seed": k}).json() for k in (1, 2)]
    assert {job["person"] for job in made} == {"wanda"}
    first, second = (job["url"] for job in made)
    tries = (("POST", f"{first}/cancel", None), ("PATCH", first, {"note": "x"}), ("DELETE", first, None))
    for method, path, body in tries:
        refused = ask_as(plant, "willi", method, path, json=body)
        assert (refused.status_code, "only wanda or an administrator" in refused.json()["detail"]) == (403, True)
    assert ask_as(plant, "wanda", "POST", f"{first}/cancel").json()["state"] == "cancelled"
    assert ask_as(plant, "ada", "POST", f"{second}/cancel").json()["state"] == "cancelled"
    again = ask_as(plant, "willi", "POST", "/api/plans", json={"cell": "ur10/edbb", "seed": 1}).json()
    assert (again["id"], again["person"], again["state"]) == (made[0]["id"], "willi", "queued")
    listed = [j["id"] for j in ask_as(plant, "luis", "GET", "/api/jobs", params={"person": "wanda"}).json()]
    assert listed == [made[1]["id"]]
    assert ask_as(plant, "ada", "DELETE", second).status_code == 204


def test_a_job_that_two_have_asked_for_belongs_to_both(plant):
    plant.people.add("bob", Role.WORK, None)
    plant.tokens["bob"] = plant.people.make_token("bob", "x")
    asked = {"cell": "ur10/edbb", "seed": 7}
    job = ask_as(plant, "wanda", "POST", "/api/plans", json=asked).json()["url"]
    assert ask_as(plant, "bob", "POST", "/api/plans", json=asked).json()["people"] == ["bob", "wanda"]
    listed = [j["url"] for j in ask_as(plant, "luis", "GET", "/api/jobs", params={"person": "bob"}).json()]
    assert listed == [job]
    assert ask_as(plant, "bob", "PATCH", job, json={"note": "x"}).status_code == 200
    assert ask_as(plant, "wanda", "POST", f"{job}/cancel").json()["state"] == "queued", "it goes on for the other"
    left = ask_as(plant, "bob", "GET", job).json()
    assert (left["people"], left["person"]) == (["bob"], "bob")
    assert ask_as(plant, "wanda", "DELETE", job).status_code == 403
    assert ask_as(plant, "bob", "POST", f"{job}/cancel").json()["state"] == "cancelled"
    ask_as(plant, "wanda", "POST", "/api/plans", json=asked)
    ask_as(plant, "bob", "POST", "/api/plans", json=asked)
    ask_as(plant, "ada", "POST", f"{job}/cancel")
    assert ask_as(plant, "wanda", "DELETE", job).status_code == 204
    assert ask_as(plant, "bob", "GET", job).status_code == 200, "what one deletes the other keeps"
    assert ask_as(plant, "bob", "DELETE", job).status_code == 204
    assert ask_as(plant, "bob", "GET", job).status_code == 404


def test_a_name_is_never_used_twice_for_other_people(plant):
    plant.people.add("berta", Role.WORK, None)
    plant.tokens["berta"] = plant.people.make_token("berta", "x")
    ask_as(plant, "berta", "POST", "/api/plans", json={"cell": "ur10/edbb", "seed": 8})
    plant.people.remove("berta")
    with pytest.raises(InputError, match="somebody of this name has worked here"):
        plant.people.add("berta", Role.WORK, None)
    plant.people.add("berta", Role.WORK, None, same_person=True)
    with pytest.raises(InputError, match="berta: is known already"):
        plant.people.add("Berta", Role.WORK, None)
    plant.people.remove("berta")


def test_the_log_says_who_did_what(plant):
    made = ask_as(plant, "wanda", "POST", "/api/plans", json={"cell": "ur10/edbb", "seed": 77}).json()
    ask_as(plant, "wanda", "POST", "/api/plans", json={"cell": SOME_FILE})
    ask_as(plant, "luis", "POST", f"{made['url']}/cancel")
    ask_as(plant, "luis", "GET", "/api/jobs")
    ask_as(plant, "ada", "POST", f"{made['url']}/cancel")
    log_in(plant, "luis", "wrong password")
    log_in(plant, "luis")
    plant.cookies.clear()
    deeds = ask_as(plant, "ada", "GET", "/api/deeds", params={"most": 6}).json()
    shown = [(d["person"], d["deed"], d["status"]) for d in reversed(deeds)]
    assert shown == [
        ("wanda", "asked for: plan", 202),
        ("wanda", "asked for: plan", 404),
        ("luis", "stopped a job", 403),
        ("ada", "stopped a job", 200),
        ("luis", "tried to log in", 401),
        ("luis", "logged in", 303),
    ]
    assert deeds[-1]["subject"] == made["url"]
    assert deeds[0]["address"] == "testclient"
    pages, after = [], None
    while len(pages) < 100:
        answer = ask_as(plant, "ada", "GET", "/api/deeds", params={"most": 2} | ({"after": after} if after else {}))
        pages += answer.json()
        if "link" not in answer.headers:
            break
        after = re.search(r"after=(\d+)", answer.headers["link"])[1]
    numbers = [d["id"] for d in pages]
    assert numbers == sorted(numbers, reverse=True)
    assert len(set(numbers)) == len(numbers) > 6
    own = ask_as(plant, "ada", "GET", "/api/deeds", params={"person": "luis"}).json()
    assert {d["person"] for d in own} == {"luis"}
    assert "asked for: plan" in ask_as(plant, "ada", "GET", "/deeds").text


@pytest.mark.slow
def test_a_name_is_text_on_every_page(tmp_path):
    name = "<img src=x onerror=alert(1)>"
    people = people_of(tmp_path)
    people.add(name, Role.ADMINISTER, PASSWORD)
    with client_of(tmp_path, workers=0, beside=0) as client:
        log_in(client, name, "<script>alert(1)</script>")
        assert log_in(client, name).status_code == 303
        job = client.post("/api/plans", json={"cell": "ur10/edbb"}).json()
        for path in ("/", "/jobs", "/deeds", f"/jobs/{job['id']}", "/calibrate", "/login", f"/login?next={name}"):
            text = client.get(path).text
            assert "<img src=x" not in text
            assert "<script>alert" not in text
        assert "&lt;img src=x" in client.get("/deeds").text
        assert job["person"] == name


def test_one_person_has_no_more_than_the_quota(tmp_path):
    people = add_all(tmp_path)
    with client_of(tmp_path, workers=0, beside=0, quota=Quota(2, 1000)) as client:
        client.tokens = {name: people.make_token(name, "x") for name in ROLES}
        asked = [{"cell": "ur10/edbb", "seed": k} for k in range(3)]
        codes = [ask_as(client, "wanda", "POST", "/api/plans", json=body).status_code for body in (*asked, asked[0])]
        assert codes == [202, 202, 429, 202], "the same again is no further job"
        view = {"cell": "ur10/edbb"}
        assert ask_as(client, "wanda", "POST", "/api/cell-checks", json=view).status_code == 202, "pages go on"
        assert ask_as(client, "ada", "POST", "/api/plans", json=asked[2]).status_code == 202
        client.headers["authorization"] = f"Bearer {client.tokens['luis']}"
        client.headers["authorization"] = f"Bearer {client.tokens['ada']}"
        upload(client, "files", b"x" * 1001, "a.txt")
        full = client.post("/api/files", params={"name": "b.txt"}, content=b"y")
        assert full.status_code == 429
        assert "delete jobs" in full.json()["detail"]
        client.headers.pop("authorization")
        assert ask_as(client, "wanda", "POST", "/api/files?name=c.txt", content=b"z").status_code == 201


def test_the_files_of_a_person_are_those_written_and_sent(tmp_path):
    context = build_context(settings(tmp_path))
    context.jobs.submit("a" * 24, "plan", "x", "{}", JobCommand(("plan",)), person="wanda")
    job = context.jobs.take(1)
    data = context.files.add(b"12345")
    context.jobs.finish(job, "done", [JobOutput("plan.json", data, 5)], 0, None)
    assert [context.keeper.size_bytes(person) for person in ("wanda", "ada", None)] == [5, 0, 5]


def test_the_commands(tmp_path, monkeypatch):
    def users(*words, typed=""):
        monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
        return edbb("serve", "users", *words, "--data", tmp_path)

    assert "has to be an administrator" in users("add", "ada", typed=f"{PASSWORD}\n").screen
    assert users("add", "ada", "--role", "administer", typed=f"{PASSWORD}\n").returncode == 0
    assert users("add", "wanda", "--no-password").returncode == 0
    assert users("passwd", "wanda", typed="another good password\n").returncode == 0
    assert users("role", "wanda", "--role", "look").returncode == 0
    token = users("token", "wanda", "--label", "cell 7").stdout.strip()
    assert users("list").stdout.splitlines() == ["ada  administer  password", "wanda  look  password, token 'cell 7'"]
    people = people_of(tmp_path)
    assert people.by_token(token).name == "wanda"
    assert people.log_in("wanda", "another good password")
    assert users("untoken", "wanda", "--label", "cell 7").returncode == 0
    assert people.by_token(token) is None
    assert users("remove", "wanda").returncode == 0
    assert [p.name for p in people.list_people()] == ["ada"]
    for words in (("remove", "ada"), ("remove", "x"), ("passwd",), ("role", "ada"), ("dance",)):
        assert users(*words, typed=f"{PASSWORD}\n").returncode == 2


def test_a_program_gives_its_token_by_file(tmp_path, monkeypatch):
    from planner.cli.terminal import environment_token

    (tmp_path / "token").write_text("edbb_abc\n")
    monkeypatch.delenv("EDBB_TOKEN", raising=False)
    assert environment_token() == ""
    monkeypatch.setenv("EDBB_TOKEN_FILE", str(tmp_path / "token"))
    assert environment_token() == "edbb_abc"
    monkeypatch.setenv("EDBB_TOKEN", "x")
    with pytest.raises(InputError, match="both set"):
        environment_token()
    monkeypatch.delenv("EDBB_TOKEN")
    monkeypatch.setenv("EDBB_TOKEN_FILE", str(tmp_path / "none"))
    with pytest.raises(InputError, match="cannot be read"):
        environment_token()


def test_a_store_of_before_has_jobs_of_nobody(plant):
    """Whoever works may change what nobody owns; times of sessions are whole hours and days."""
    assert people_module.SESSION_S > people_module.IDLE_S
    context = plant.app._context
    context.jobs.submit("e" * 24, "plan", "old", json.dumps({}), JobCommand(("plan",)))
    assert ask_as(plant, "luis", "PATCH", f"/api/jobs/{'e' * 24}", json={"note": "x"}).status_code == 403
    assert ask_as(plant, "wanda", "PATCH", f"/api/jobs/{'e' * 24}", json={"note": "x"}).status_code == 200
