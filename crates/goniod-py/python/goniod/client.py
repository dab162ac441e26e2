"""The daemon as an object: jobs, what happens, and results, over its HTTP interface."""

from __future__ import annotations

import http.client
import json
import socket
import ssl
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

from goniod.run import Run

Json = dict[str, Any]
_OVER = ("done", "failed", "cancelled", "interrupted")
_TIMEOUT_S = 30.0


class DaemonError(Exception):
    """The daemon refused a request, or cannot be reached; ``status`` is the one of HTTP, or ``None``.

    >>> str(goniod.DaemonError("no such job", 404))
    'no such job'
    """

    def __init__(self, text: str, status: int | None = None) -> None:
        super().__init__(text)
        self.status = status


class JobError(Exception):
    """A job ended otherwise than done; ``job`` is the job as the daemon has it.

    >>> goniod.JobError({"id": "1", "state": "cancelled", "why": None}).job["state"]
    'cancelled'
    """

    def __init__(self, job: Json) -> None:
        super().__init__(f"job {job['id']} is {job['state']}{': ' + job['why'] if job.get('why') else ''}")
        self.job = job


@dataclass(frozen=True)
class Event:
    """Something that happened: its ``id``, its ``kind``, such as "job", "reading" or "fault", and all of its ``data``.

    >>> goniod.Event(7, "warning", {"text": "the lamp drifts"}).data["text"]
    'the lamp drifts'
    """

    id: int | None
    kind: str
    data: Json


class Client:
    """A client of the daemon at a URL such as http://127.0.0.1:4664, or unix:/run/goniod/goniod.sock.

    ``token`` is one of the daemon's token file; over the Unix socket there is none.

    >>> client = goniod.Client(daemon_url, daemon_token)
    >>> client.rig()["activity"]
    'idle'
    """

    def __init__(self, url: str, token: str | None = None) -> None:
        """Name the daemon; nothing is asked of it yet.

        >>> goniod.Client("ftp://lab")
        Traceback (most recent call last):
            ...
        ValueError: the URL is 'ftp://lab'; allowed are http://HOST:PORT, https://HOST and unix:PATH
        """
        parts = urlsplit(url)
        known = parts.scheme in ("http", "https") and parts.hostname or parts.scheme == "unix" and parts.path
        if not known:
            raise ValueError(f"the URL is {url!r}; allowed are http://HOST:PORT, https://HOST and unix:PATH")
        self._url, self._parts = url, parts
        self._token = token.strip() if token else None

    def _connect(self, timeout: float) -> http.client.HTTPConnection:
        parts = self._parts
        if parts.scheme == "unix":
            return _UnixConnection(parts.path, timeout)
        host = parts.hostname or ""
        if parts.scheme == "https":
            return http.client.HTTPSConnection(host, parts.port, timeout=timeout, context=ssl.create_default_context())
        return http.client.HTTPConnection(host, parts.port, timeout=timeout)

    def _send(
        self,
        method: str,
        path: str,
        body: bytes | None = None,
        headers: dict[str, str] | None = None,
        timeout: float = _TIMEOUT_S,
    ) -> tuple[http.client.HTTPConnection, http.client.HTTPResponse]:
        """Send a request, and take the head of its answer; the caller closes the connection."""
        connection = self._connect(timeout)
        headers = dict(headers or {})
        if self._token:
            headers["Authorization"] = f"Bearer {self._token}"
        base = "" if self._parts.scheme == "unix" else self._parts.path.rstrip("/")
        try:
            connection.request(method, f"{base}/api/v1{path}", body, headers)
            response = connection.getresponse()
            if response.status >= 400:
                text = response.read().decode("utf-8", "replace")
                raise DaemonError(_detail(text) or f"{self._url} answers {response.status}", response.status)
        except BaseException as error:
            connection.close()
            if isinstance(error, (OSError, http.client.HTTPException)):
                raise DaemonError(f"the daemon at {self._url} cannot be reached: {error}") from error
            raise
        return connection, response

    def _ask(
        self, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None
    ) -> Any:
        connection, response = self._send(method, path, body, headers)
        try:
            text = response.read()
        except (OSError, http.client.HTTPException) as error:
            raise DaemonError(f"the daemon at {self._url} broke off its answer: {error}") from error
        finally:
            connection.close()
        return json.loads(text) if text else None

    def rig(self) -> Json:
        """Get where the arms are, and all else that is known of the rig.

        >>> light, sensor = goniod.Client(daemon_url, daemon_token).rig()["arms"]
        >>> light["min_deg"] <= light["measured_deg"] <= light["max_deg"]
        True
        """
        found: Json = self._ask("GET", "/rig")
        return found

    def plan(self, job: str | PathLike[str]) -> Json:
        """Get what would be done for a job; nothing moves.

        >>> goniod.Client(daemon_url, daemon_token).plan(job_toml)["seconds"] > 0
        True
        """
        headers = {"Content-Type": "application/toml"}
        found: Json = self._ask("POST", "/plan", _job_text(job)[0].encode(), headers)
        return found

    def submit(self, job: str | PathLike[str], *, name: str | None = None) -> str:
        """Add a job to the queue: the text of a job file, TOML, or the path of one; its id.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> job = client.submit(waiting_toml)
        >>> client.job(job)["id"] == job
        True
        >>> client.cancel(job)["state"]
        'cancelled'
        """
        text, file_name = _job_text(job)
        path = f"/jobs?name={quote(name or file_name, safe='')}"
        found: Json = self._ask("POST", path, text.encode(), {"Content-Type": "application/toml"})
        return str(found["id"])

    def job(self, id: str) -> Json:
        """Get one job: its "state", "why" it stands so, its "run" and the "verdict" on that.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> client.job("01KAGN4Z7Q3X9V5T8R2M6C1D0B")
        Traceback (most recent call last):
            ...
        goniod.client.DaemonError: there is no job 01KAGN4Z7Q3X9V5T8R2M6C1D0B
        """
        found: Json = self._ask("GET", f"/jobs/{quote(id, safe='')}")
        return found

    def jobs(self) -> list[Json]:
        """Get the jobs, in the order in which they are worked off.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> done_job in [known["id"] for known in client.jobs()]
        True
        """
        found: list[Json] = self._ask("GET", "/jobs")
        return found

    def ready(self, id: str) -> Json:
        """Say that the specimen of a job lies on the stage: it starts.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> client.ready("01KAGN4Z7Q3X9V5T8R2M6C1D0B")
        Traceback (most recent call last):
            ...
        goniod.client.DaemonError: there is no job 01KAGN4Z7Q3X9V5T8R2M6C1D0B
        """
        return self._act(id, "ready")

    def cancel(self, id: str) -> Json:
        """Give a job up that does not run.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> client.cancel(client.submit(waiting_toml))["state"]
        'cancelled'
        """
        return self._act(id, "cancel")

    def resume(self, id: str) -> Json:
        """Go on with a job that was interrupted.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> client.resume("01KAGN4Z7Q3X9V5T8R2M6C1D0B")
        Traceback (most recent call last):
            ...
        goniod.client.DaemonError: there is no job 01KAGN4Z7Q3X9V5T8R2M6C1D0B
        """
        return self._act(id, "resume")

    def _act(self, id: str, action: str) -> Json:
        found: Json = self._ask("POST", f"/jobs/{quote(id, safe='')}/{action}")
        return found

    def stop(self) -> None:
        """Brake now; the run can be resumed, and nothing starts until an operator starts or resumes a job.

        >>> goniod.Client(daemon_url, daemon_token).stop()
        """
        self._ask("POST", "/stop")

    def estop(self) -> None:
        """Stop in an emergency: arms and lamp at once, and no motion until the fault is acknowledged.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> client.estop()
        >>> client.acknowledge(client.rig()["fault"]["id"])
        """
        self._ask("POST", "/estop")

    def acknowledge(self, fault: str) -> None:
        """Acknowledge the newest fault by its id: somebody has looked at the rig. Nothing starts by it.

        >>> goniod.Client(daemon_url, daemon_token).acknowledge("nonsense")
        Traceback (most recent call last):
            ...
        goniod.client.DaemonError: ...
        """
        body = json.dumps({"fault": fault}).encode()
        self._ask("POST", "/acknowledge", body, {"Content-Type": "application/json"})

    def events(self, after: int | None = None, *, rig: bool = False) -> Iterator[Event]:
        """Iterate over what happens, as it happens: from now on, or with what came ``after`` the event of that id.

        A connection that breaks is made anew, and nothing is lost; an event "gap" says where something is. With ``rig`` the
        pictures of the rig come as well, up to twenty a second. It goes on until the caller stops asking.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> events = client.events()
        >>> job = client.submit(waiting_toml)
        >>> next(event.data["job"]["state"] for event in events if event.kind == "job")
        'queued'
        >>> client.cancel(job)["why"] is None
        True
        """
        # What happens between this call and the first event asked for must not be missed.
        stream = self._open(after)

        def iterate() -> Iterator[Event]:
            last, connection, response = after, *stream
            while True:
                try:
                    for event in _parse(response):
                        last = event.id if event.id is not None else last
                        if rig or event.kind != "rig":
                            yield event
                except (OSError, http.client.HTTPException):
                    pass
                finally:
                    connection.close()
                connection, response = self._open(last)

        return iterate()

    def _open(self, after: int | None) -> tuple[http.client.HTTPConnection, http.client.HTTPResponse]:
        headers = {"Accept": "text/event-stream"}
        if after is not None:
            headers["Last-Event-ID"] = str(after)
        return self._send("GET", "/events", headers=headers)

    def wait(self, id: str, *, on_specimen: Callable[[Json], bool] | None = None) -> Json:
        """Wait until a job is done; the job.

        ``JobError`` where it ends otherwise: failed, cancelled, or interrupted, which can be resumed. Where the job waits for
        its specimen, ``on_specimen`` is asked: if it says that the specimen lies on the stage, the job starts.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> client.wait(done_job)["state"]
        'done'
        """
        events = self.events()
        job, asked = self.job(id), False
        while job["state"] not in _OVER:
            if job["state"] == "awaiting_specimen" and on_specimen is not None and not asked:
                asked = True
                if on_specimen(job):
                    self.ready(id)
            for event in events:
                if event.kind == "gap":
                    job = self.job(id)
                    break
                if event.kind == "job" and event.data["job"]["id"] == id:
                    job = event.data["job"]
                    break
        if job["state"] != "done":
            raise JobError(job)
        # The verdict comes with the report, after the last event on the state.
        return self.job(id)

    def results(self, id: str) -> Json:
        """Get the run of a job: its verdict, seconds and counts.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> client.results(done_job)["id"] == client.job(done_job)["run"]
        True
        """
        found: Json = self._ask("GET", f"/runs/{self._run(id)}")
        return found

    def files(self, id: str) -> list[str]:
        """Get the names of the files that the run of a job left.

        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> "readings.csv" in client.files(done_job)
        True
        """
        found = self._ask("GET", f"/runs/{self._run(id)}/files")
        return [file["name"] if isinstance(file, dict) else str(file) for file in found]

    def download(self, id: str, folder: str | PathLike[str]) -> Run:
        """Download the run directory of a job into a folder, which is made where there is none.

        >>> import tempfile
        >>> client = goniod.Client(daemon_url, daemon_token)
        >>> client.download(done_job, tempfile.mkdtemp()).info["state"]
        'done'
        """
        run, folder = self._run(id), Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for name in self.files(id):
            if Path(name).name != name:
                raise DaemonError(f"the daemon names a file {name!r}, which is no plain name")
            connection, response = self._send("GET", f"/runs/{run}/files/{quote(name, safe='')}")
            try:
                partial = folder / f".{name}.partial"
                with open(partial, "wb") as file:
                    while block := response.read(1 << 20):
                        file.write(block)
                partial.replace(folder / name)
            finally:
                connection.close()
        return Run(folder)

    def _run(self, id: str) -> str:
        run = self.job(id)["run"]
        if run is None:
            raise DaemonError(f"job {id} has not begun, so it has no run")
        return quote(str(run), safe="")


class _UnixConnection(http.client.HTTPConnection):
    """HTTP over a Unix socket."""

    def __init__(self, path: str, timeout: float) -> None:
        super().__init__("localhost", timeout=timeout)
        self._path, self._timeout = path, timeout

    def connect(self) -> None:
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self._timeout)
        self.sock.connect(self._path)


def _job_text(job: str | PathLike[str]) -> tuple[str, str]:
    """The text of a job and the name of its file: whatever has a line break or an equals sign is a text."""
    if isinstance(job, str) and ("\n" in job or "=" in job):
        return job, "job.toml"
    path = Path(job)
    return path.read_text("utf-8"), path.name


def _detail(text: str) -> str | None:
    """What a problem document (RFC 9457) says."""
    try:
        problem = json.loads(text)
    except ValueError:
        return text.strip() or None
    return str(problem["detail"]) if isinstance(problem, dict) and problem.get("detail") else None


def _parse(response: http.client.HTTPResponse) -> Iterator[Event]:
    """The server-sent events of an answer, as the HTML standard has them."""
    id: int | None = None
    kind, lines = "message", list[str]()
    for raw in iter(response.readline, b""):
        line = raw.decode("utf-8").rstrip("\r\n")
        if not line:
            if lines:
                data = json.loads("\n".join(lines))
                # Pictures of the rig are named by the stream, what happened by itself.
                yield Event(id, kind if kind != "message" else str(data.get("event", kind)), data)
            id, kind, lines = None, "message", []
            continue
        field, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if field == "id":
            id = int(value)
        elif field == "event":
            kind = value
        elif field == "data":
            lines.append(value)
