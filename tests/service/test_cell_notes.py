"""Cells have a name and a note of their people."""

import pytest

from planner.service.people import PeopleStore
from tests.service.conftest import client_of, upload
from tests.service.test_interface import CELL
from tests.service.test_people import add_all, ask_as


@pytest.mark.slow
def test_a_cell_is_called_what_its_people_call_it(tmp_path):
    with client_of(tmp_path, workers=0, beside=0) as client:
        cell = upload(client, "cells", CELL, "mine.toml")["id"]
        named = client.patch(f"/api/cells/{cell}", json={"title": "Hall 3 <b>", "note": "the fixture was moved"})
        assert named.json() == {"id": cell, "name": "Hall 3 <b>", "note": "the fixture was moved"}
        assert client.patch(f"/api/cells/{cell}", json={"note": ""}).json()["name"] == "Hall 3 <b>"
        assert named.json()["name"] in [c["name"] for c in client.get("/api/cells").json()]
        plan = client.post("/api/plans", json={"cell": cell}).json()
        assert plan["title"] == "Hall 3 <b>"
        assert client.patch(f"/api/cells/{cell}", json={"title": ""}).json()["name"] == "mine.toml"
        assert client.patch(f"/api/cells/{cell}", json={"colour": "red"}).status_code == 422
        assert client.patch(f"/api/cells/{'0' * 64}", json={"note": "x"}).status_code == 404
        check = client.post("/api/cell-checks", json={"cell": cell}).json()
        client.patch(f"/api/cells/{cell}", json={"title": "Hall 3 <b>"})
        page = client.get(f"/cells/{cell}", params={"check": check["id"]}).text
        assert "Hall 3 &lt;b&gt;" in page
        assert 'id="naming-form"' in page
        assert 'id="naming-form"' not in client.get("/cells/ur10/edbb").text


def test_another_person_leaves_it(tmp_path):
    people: PeopleStore = add_all(tmp_path)
    with client_of(tmp_path, workers=0, beside=0) as client:
        client.tokens = {name: people.make_token(name, "x") for name in ("ada", "wanda", "luis")}
        sent = ask_as(client, "ada", "POST", "/api/cells?name=mine.toml", content=CELL)
        path = f"/api/cells/{sent.json()['id']}"
        assert ask_as(client, "wanda", "PATCH", path, json={"note": "x"}).status_code == 403
        assert ask_as(client, "ada", "PATCH", path, json={"note": "x"}).status_code == 200
