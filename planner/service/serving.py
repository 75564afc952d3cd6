"""``edbb serve``: the application, and the server that runs it."""

import logging
import sqlite3
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from http import HTTPStatus
from typing import Any

from fastapi import Depends, FastAPI
from fastapi.staticfiles import StaticFiles
from starlette.types import ASGIApp

from planner import __version__
from planner.common.errors import InputError
from planner.report.page import VIEW_FOLDER
from planner.service.access import check_access, check_rules
from planner.service.callers import COOKIE, CallerFinder, GuessLimit
from planner.service.certificate_api import CERTIFICATES
from planner.service.cluster import Cluster
from planner.service.context import ServiceContext, Supervisor
from planner.service.database import Database, damage_text
from planner.service.deeds import DEEDS
from planner.service.file_api import FILES, LISTS
from planner.service.file_store import CellNotes, FileStore, UploadList, disk_error
from planner.service.guards import Guard
from planner.service.job_api import EVENTS, JOBS
from planner.service.job_keeping import JobKeeper, Sweeper
from planner.service.job_process import confinement_version
from planner.service.job_store import JobStore
from planner.service.login import LOGIN
from planner.service.methods import AccessLog, PlainMethods, open_log
from planner.service.metrics import METRICS
from planner.service.pages import PAGES, add_problem_handlers, prepare_pages
from planner.service.people import DeedLog, PeopleStore
from planner.service.private_store import DATABASE, keep_private
from planner.service.problems import MEDIA_TYPE, Problem
from planner.service.record_api import RECORDS
from planner.service.record_store import RecordStore
from planner.service.rendering import STATIC
from planner.service.robot_pages import ROBOT_PAGES
from planner.service.session_api import SESSIONS
from planner.service.session_store import SessionStore
from planner.service.settings import GB, JobShares, ServiceSettings
from planner.service.standing import Judge
from planner.service.webhook import Notifier

DESCRIPTION = (
    "Plans measuring sessions that calibrate robots, and identifies robots from measured runs. What takes long is a "
    "job: it is accepted once (the same content is the same job), followed by events, and leaves files."
)
PROBLEMS: dict[int | str, dict[str, Any]] = {
    code: {"model": Problem, "description": text}
    for code, text in (
        (400, "no JSON, or a broken body"),
        (401, "nobody has said who asks"),
        (403, "another site asks, or the person may not do this"),
        (404, "something that is named is not there"),
        (409, "it cannot be done now, or a file came disturbed"),
        (413, "more bytes than are taken"),
        (421, "the service is not known by that name"),
        (422, "the request or what it names is wrong"),
        (429, "more than one may ask for, or have"),
        (507, "the disk is full"),
    )
}


def build_context(settings: ServiceSettings) -> ServiceContext:
    """Open the stores of a folder, and return them as the service's context.

    Raises:
        InputError: the folder cannot be used.
    """
    for notice in keep_private(settings.folder):
        logging.getLogger("edbb.service").warning("%s", notice)
    try:
        files = FileStore(settings.folder, settings.reserve)
    except OSError as err:
        raise disk_error(err) from err
    database = Database(settings.folder / DATABASE)
    jobs = JobStore(database)
    try:
        jobs.running_jobs()
    except sqlite3.DatabaseError as err:
        raise InputError(damage_text(err)) from err
    cluster = Cluster(settings.cluster, settings.limits) if settings.cluster.scheduler else None
    supervisor = Supervisor(jobs, files, settings.folder, settings.workers, settings.limits, settings.beside, cluster)
    records = RecordStore(settings.folder, jobs, files, database)
    judge = Judge(jobs, files, records)
    keeper = JobKeeper(database, jobs, files, records.index)
    people, guesses = PeopleStore(database, settings.token), GuessLimit()
    settings.check_door(people.exist())
    finder = CallerFinder(settings, people, guesses, cluster.token if cluster else "")
    return ServiceContext(
        settings=settings,
        jobs=jobs,
        files=files,
        uploads=UploadList(database),
        records=records,
        keeper=keeper,
        supervisor=supervisor,
        people=people,
        guesses=guesses,
        finder=finder,
        deeds=DeedLog(database),
        sessions=SessionStore(database),
        judge=judge,
        cells=CellNotes(database),
        notifier=Notifier(settings.webhooks, database, jobs),
    )


def build_app(context: ServiceContext) -> FastAPI:
    """Return the application without its guard, for its OpenAPI document."""

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        """Run what the service needs while it serves."""
        sweeper = Sweeper(context.keeper, context.settings.kept)
        context.supervisor.start()
        sweeper.start()
        context.notifier.start()
        threading.Thread(target=prepare_pages, name="pages", daemon=True).start()
        yield
        context.notifier.stop()
        sweeper.stop()
        context.supervisor.stop()

    app = FastAPI(
        title="edbb",
        version=__version__,
        description=DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
        responses=PROBLEMS,
        dependencies=[Depends(check_access)],
    )
    app.state.context = context
    add_problem_handlers(app)
    pages = (LOGIN, PAGES, ROBOT_PAGES)
    for router in (JOBS, EVENTS, LISTS, FILES, RECORDS, CERTIFICATES, SESSIONS, DEEDS, METRICS, *pages):
        app.include_router(router)
    check_rules(app)
    app.mount("/static/view", StaticFiles(directory=VIEW_FOLDER), name="view")
    app.mount("/static", StaticFiles(directory=STATIC), name="static")
    describe = app.openapi

    def describe_once() -> dict[str, Any]:
        """Return the OpenAPI description, which is made once."""
        return app.openapi_schema or _complete_document(describe())

    app.openapi = describe_once  # type: ignore[method-assign]
    return app


def _complete_document(document: dict[str, Any]) -> dict[str, Any]:
    """Say in an OpenAPI document how one logs in, and of every problem that it is ``application/problem+json``."""
    schema = {"$ref": "#/components/schemas/Problem"}
    schemes = {
        "token": {"type": "http", "scheme": "bearer", "description": "of a person, or of the service"},
        "session": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "of a browser that has logged in"},
    }
    document["components"]["securitySchemes"] = schemes
    # the last: nobody has to log in where one person works on one machine
    document["security"] = [*({name: []} for name in schemes), {}]
    for operations in document["paths"].values():
        for operation in operations.values():
            for code, answer in operation["responses"].items():
                if code >= "400":
                    status, detail = int(code), answer["description"]
                    example = {"type": "about:blank", "title": HTTPStatus(status).phrase, "status": status}
                    answer["content"] = {MEDIA_TYPE: {"schema": schema, "example": example | {"detail": detail}}}
    return document


def add_guard(settings: ServiceSettings) -> ASGIApp:
    """Return the application behind its guard."""
    context = build_context(settings)
    app = build_app(context)
    guarded = Guard(PlainMethods(app, app), context)
    return AccessLog(guarded) if settings.access_log else guarded


def start_notices(workers: int | None, shares: JobShares) -> list[str]:
    """Return what whoever starts the service should know: what this machine cannot do that was asked or is promised."""
    said = []
    if workers is not None and shares.workers < workers:
        memory = f"{shares.memory_bytes / GB:.3g} GB"
        said.append(f"jobs at a time: {shares.workers}, not {workers}, as each may use {memory} and has a core")
    if confinement_version() == 0:
        said.append(
            "jobs are not confined: this system has no Landlock (Linux 5.13 or later, and not switched off). Only the "
            "files that commands read are held to a job's folder, so serve nobody whom you do not trust"
        )
    return said


def serve(settings: ServiceSettings, announce: Callable[[str], None]) -> None:
    """Serve until a signal ends it; jobs that run then go on with the next server.

    Raises:
        InputError: the folder or the address cannot be used.
    """
    import uvicorn

    from planner.service.methods import TimedProtocol

    app = add_guard(settings)
    if settings.access_log:
        open_log(settings.access_log)
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    config = uvicorn.Config(
        app,
        http=TimedProtocol,
        host=settings.host,
        port=settings.port,
        log_level="warning",
        access_log=False,
        proxy_headers=False,  # which proxies are believed is said by --proxy
        server_header=False,
        timeout_graceful_shutdown=3,  # [s] for open requests when the server stops
        limit_concurrency=1000,
        h11_max_incomplete_event_size=64 << 10,
    )
    try:
        socket = config.bind_socket()
    except SystemExit as err:
        raise InputError(
            f"{host}:{settings.port}: cannot be listened on; is another service there? Name another --port"
        ) from err
    # 1024: connections that wait to be taken
    socket.listen(1024)  # whoever reads the address may ask at once
    announce(f"http://{host}:{socket.getsockname()[1]}")
    uvicorn.Server(config).run([socket])
