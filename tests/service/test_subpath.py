"""Behind a proxy at a path of its host: every link, script and request stays below it; and who a proxy says asks."""

import base64
import hashlib
import re
import shutil
import subprocess
import threading
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect

from planner.common.errors import InputError
from planner.service.database import Database
from planner.service.people import PeopleStore
from planner.service.settings import Role
from tests.service.conftest import client_of, settings, wait_until
from tests.service.test_cell_side import JOB, PASSWORD, Service, add_plan, browser, needs_browser, open_page  # noqa: F401
from tests.service.test_cluster import free_port

NGINX = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
NGINX_CONF = """
daemon off; pid {folder}/pid; error_log {folder}/error.log;
events {{}}
http {{
    access_log off;
    client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy; fastcgi_temp_path {folder}/f;
    uwsgi_temp_path {folder}/u; scgi_temp_path {folder}/s;
    server {{
        listen 127.0.0.1:{port};
        {locations}
    }}
}}
"""
SUBPATH = """
        location /edbb/ {{
            proxy_pass http://127.0.0.1:{service}/;
            proxy_set_header Host $http_host;
            proxy_buffering off;
        }}
"""
ASKING = """
        location = /oauth2/auth {{
            proxy_pass http://127.0.0.1:{asked};
            proxy_set_header Content-Length "";
            proxy_pass_request_body off;
        }}
        location / {{
            auth_request /oauth2/auth;
            auth_request_set $person $upstream_http_x_auth_request_user;
            proxy_set_header X-Forwarded-User $person;
            proxy_pass http://127.0.0.1:{service};
            proxy_set_header Host $http_host;
            proxy_set_header X-Forwarded-For $remote_addr;
        }}
"""


@pytest.mark.slow
def test_pages_links_and_headers_stay_below_the_path(tmp_path):
    add_plan(tmp_path)
    with client_of(tmp_path, workers=0, beside=0, root_path="/edbb") as client:
        for path in (
            "/",
            "/jobs",
            "/calibrate",
            f"/jobs/{JOB}",
            f"/jobs/{JOB}/session",
            "/edbb/jobs",
            "/login",
            "/deeds",
        ):
            text = client.get(path).text
            links = re.findall(r'(?:src|href|action)="([^"#][^"]*)"', text)
            assert links
            assert all(link.startswith("/edbb/") for link in links), links
            for link in {link for link in links if "/static/" in link}:
                assert client.get(link).status_code == client.get(link.removeprefix("/edbb")).status_code == 200
        made = client.post("/api/plans", json={"cell": "ur10/edbb"})
        assert made.headers["location"] == f"/edbb/api/jobs/{made.json()['id']}"
        assert client.get("/api/jobs", params={"most": 1}).headers["link"].startswith("</edbb/api/jobs?")


@pytest.mark.parametrize("path", ["edbb", "/edbb/", "/a b", '/"x'])
def test_paths_that_are_none(tmp_path, path):
    with pytest.raises(InputError, match="--root-path"):
        settings(tmp_path, root_path=path)


def begin_nginx(folder, port, locations):
    folder.mkdir()
    (folder / "conf").write_text(NGINX_CONF.format(folder=folder, port=port, locations=locations))
    process = subprocess.Popen([NGINX, "-c", folder / "conf", "-e", folder / "error.log"])
    for _ in range(100):
        try:
            httpx.get(f"http://127.0.0.1:{port}/none")
            return process
        except httpx.TransportError:
            threading.Event().wait(0.1)
    raise AssertionError((folder / "error.log").read_text())


needs_nginx = pytest.mark.skipif(NGINX is None, reason="there is no nginx here")


@needs_nginx
@needs_browser
@pytest.mark.long
def test_a_browser_works_behind_nginx_at_a_path(tmp_path, browser):  # noqa: F811
    people = PeopleStore(Database(tmp_path / "jobs.sqlite3"))
    people.add("ada", Role.ADMINISTER, PASSWORD)
    add_plan(tmp_path, "ada")
    service, port = Service(tmp_path, "--root-path", "/edbb").begin(), free_port()
    nginx = begin_nginx(tmp_path / "nginx", port, SUBPATH.format(service=service.port))
    try:
        page = browser.new_context().new_page()
        faults = []
        page.on("pageerror", lambda fault: faults.append(str(fault)))
        page.on("response", lambda r: faults.append(r.url) if r.status >= 400 else None)
        page.goto(f"http://127.0.0.1:{port}/edbb/jobs")
        page.fill("#name", "ada")
        page.fill("#password", PASSWORD)
        page.get_by_role("button", name="Log in").click()
        expect(page.locator("#jobs tbody tr")).to_have_count(1)
        page.click("#jobs a")
        expect(page).to_have_url(f"http://127.0.0.1:{port}/edbb/jobs/{JOB}")
        page.click("text=Go to the cell")
        expect(page.locator("#offline")).to_contain_text("without a network")
        page.check("#step-1")
        expect(page.locator("#sent")).to_contain_text("All that is ticked is sent")
        service.cut()
        page.reload()
        assert page.is_checked("#step-1")
        service.begin()
        page.goto(f"http://127.0.0.1:{port}/edbb/cells/ur10/edbb")
        page.wait_for_selector("#view canvas")
        page.goto(f"http://127.0.0.1:{port}/edbb/")
        page.click("text=Log out")
        expect(page).to_have_url(f"http://127.0.0.1:{port}/edbb/login")
        assert not [f for f in faults if "127.0.0.1" not in f or "/edbb/" not in f], faults
    finally:
        nginx.terminate()
        nginx.wait()
        service.cut()


class Asked(BaseHTTPRequestHandler):
    """Stands for oauth2-proxy: whoever has its cookie is wanda."""

    def do_GET(self):
        known = "sso=wanda" in self.headers.get("cookie", "")
        self.send_response(202 if known else 401)
        if known:
            self.send_header("X-Auth-Request-User", "wanda")
        self.send_header("content-length", "0")
        self.end_headers()

    def log_message(self, *_):
        pass


@needs_nginx
@pytest.mark.long
def test_the_log_in_of_a_plant_by_nginx_and_a_program_that_is_asked(tmp_path):
    """The worked example of the documentation, with a stand-in for oauth2-proxy; names of browsers count not."""
    PeopleStore(Database(tmp_path / "jobs.sqlite3")).add("ada", Role.ADMINISTER, PASSWORD)
    service = Service(
        tmp_path, "--proxy", "127.0.0.1", "--proxy-user", "X-Forwarded-User", "--proxy-role", "look"
    ).begin()
    asked, port = HTTPServer(("127.0.0.1", 0), Asked), free_port()
    threading.Thread(target=asked.serve_forever, daemon=True).start()
    nginx = begin_nginx(tmp_path / "nginx", port, ASKING.format(service=service.port, asked=asked.server_port))
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}") as client:
            assert client.get("/api/jobs").status_code == 401
            assert client.get("/api/jobs", headers={"x-forwarded-user": "ada"}).status_code == 401
            client.cookies.set("sso", "wanda")
            page = client.get("/jobs", headers={"x-forwarded-user": "ada"})
            assert page.status_code == 200
            assert "wanda" in page.text
            assert "ada" not in page.text
            assert client.post("/api/plans", json={"cell": "ur10/edbb"}).status_code == 403, "it may look"
            assert client.get("/api/deeds").status_code == 403
    finally:
        nginx.terminate()
        nginx.wait()
        asked.shutdown()
        service.cut()


OAUTH2_PROXY = shutil.which("oauth2-proxy")
MANUAL = Path(__file__).parents[2] / "docs" / "how-to" / "serve.md"


def documented_proxy(port, asked, service):
    """The server block of the documentation, without TLS and at free ports."""
    block = MANUAL.read_text().partition("With nginx and oauth2-proxy on port 4180:")[2]
    inner = block.partition("server {\n")[2].partition("\n}\n```")[0]
    lines = [line for line in inner.splitlines() if "ssl" not in line and "server_name" not in line]
    text = "\n".join(lines).replace("127.0.0.1:4180", f"127.0.0.1:{asked}").replace("$host;", "$http_host;")
    return text.replace("127.0.0.1:8017", f"127.0.0.1:{service}").replace(
        "X-Forwarded-Proto https", "X-Forwarded-Proto http"
    )


@needs_nginx
@pytest.mark.long
@pytest.mark.skipif(OAUTH2_PROXY is None, reason="there is no oauth2-proxy here")
def test_the_log_in_of_a_plant_by_nginx_and_oauth2_proxy(tmp_path):
    """The worked example as it is documented; who logs in there is known here, and a name of the browser counts not."""
    people = PeopleStore(Database(tmp_path / "jobs.sqlite3"))
    people.add("ada", Role.ADMINISTER, PASSWORD)
    people.add("wanda", Role.WORK, None)
    hashed = base64.b64encode(hashlib.sha1(PASSWORD.encode()).digest()).decode()
    (tmp_path / "htpasswd").write_text("".join(f"{name}:{{SHA}}{hashed}\n" for name in ("wanda", "guest")))
    service = Service(
        tmp_path, "--proxy", "127.0.0.1", "--proxy-user", "X-Forwarded-User", "--proxy-role", "look"
    ).begin()
    asked, port = free_port(), free_port()
    words = (
        "--set-xauthrequest", "--reverse-proxy", f"--http-address=127.0.0.1:{asked}", "--upstream=static://202",
        "--provider=github", "--client-id=x", "--client-secret=x", f"--cookie-secret={'0123456789abcdef' * 2}",
        "--email-domain=*", "--cookie-secure=false", f"--htpasswd-file={tmp_path / 'htpasswd'}",
    )  # fmt: skip
    program = subprocess.Popen([OAUTH2_PROXY, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    nginx = begin_nginx(tmp_path / "nginx", port, documented_proxy(port, asked, service.port))
    try:
        wait_until(lambda: answers(f"http://127.0.0.1:{asked}/ping"))
        for name, may_plan in (("wanda", 202), ("guest", 403)):
            with httpx.Client(base_url=f"http://127.0.0.1:{port}", follow_redirects=True) as client:
                assert "/oauth2/sign_in" in client.get("/jobs", headers={"x-forwarded-user": "ada"}).text
                client.post("/oauth2/sign_in", data={"username": name, "password": "wrong"})
                assert name not in client.get("/jobs").text
                client.post("/oauth2/sign_in", data={"username": name, "password": PASSWORD})
                page = client.get("/jobs", headers={"x-forwarded-user": "ada"})
                assert (page.status_code, name in page.text, "ada" in page.text) == (200, True, False)
                assert client.post("/api/plans", json={"cell": "ur10/edbb", "seed": 3}).status_code == may_plan
                assert client.get("/api/deeds").status_code == 403
    finally:
        for process in (nginx, program):
            process.terminate()
            process.wait()
        service.cut()


def answers(url):
    with suppress(httpx.TransportError):
        return httpx.get(url).status_code == 200
    return False
