"""The client drives a real daemon on the simulator through a whole job."""

import socket
import threading

import goniod
import pytest


def test_a_whole_job(daemon, job_toml, tmp_path):
    client = goniod.Client(daemon.url, daemon.token)
    events = client.events()
    job = client.submit(job_toml, name="quick.toml")
    assert client.wait(job)["verdict"] is not None
    seen = []
    for event in events:
        seen.append(event)
        if event.kind == "job" and event.data["job"]["id"] == job and event.data["job"]["state"] == "done":
            break
    assert sum(event.kind == "reading" for event in seen) >= client.results(job)["accepted"]
    ids = [event.id for event in seen]
    assert ids == sorted(ids)
    run = client.download(job, tmp_path / "run")
    assert run.id == client.job(job)["run"]
    assert goniod.compare(goniod.material("gold-paint"), run.model(), pairs=10_000)["male"] < 0.003


def test_events_go_on_where_a_connection_broke(daemon, job_toml):
    client = goniod.Client(daemon.url, daemon.token)
    first = client.events()
    job = client.submit(job_toml.replace("on_stage = true", "on_stage = false"))
    known = next(first)
    client.cancel(job)
    again = client.events(after=known.id)
    assert next(again) == next(first)


def test_a_job_that_waits_for_its_specimen_is_asked_about(daemon, job_toml):
    client = goniod.Client(f"unix:{daemon.socket}")
    asked = []

    def on_specimen(job):
        asked.append(job["id"])
        return True

    job = client.submit(job_toml.replace("on_stage = true", "on_stage = false"))
    assert client.wait(job, on_specimen=on_specimen)["state"] == "done"
    assert asked == [job]


def test_a_job_that_ends_otherwise_is_an_error(daemon, job_toml):
    client = goniod.Client(daemon.url, daemon.token)
    job = client.submit(job_toml.replace("on_stage = true", "on_stage = false"))
    client.cancel(job)
    with pytest.raises(goniod.JobError, match="cancelled"):
        client.wait(job)


@pytest.mark.parametrize("ask", ["rig", "jobs", "stop"])
def test_who_has_no_token_is_told(daemon, ask):
    with pytest.raises(goniod.DaemonError) as refused:
        getattr(goniod.Client(daemon.url), ask)()
    assert refused.value.status == 401


def test_a_bad_job_is_told_with_its_line(daemon):
    with pytest.raises(goniod.DaemonError, match="line 1|kind") as refused:
        goniod.Client(daemon.url, daemon.token).submit("kind = 7\n")
    assert refused.value.status == 422 or refused.value.status == 400


def test_nobody_there_is_told_with_the_address():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    with pytest.raises(goniod.DaemonError, match=f"127.0.0.1:{port} cannot be reached"):
        goniod.Client(f"http://127.0.0.1:{port}").rig()


def test_a_stream_that_breaks_is_made_anew_with_the_last_id():
    """A server that breaks off after each event: the client says which one it had."""
    listener = socket.create_server(("127.0.0.1", 0))
    asked = []

    def serve() -> None:
        for number in (1, 2):
            connection, _ = listener.accept()
            asked.append(connection.recv(65536).decode())
            body = f'id: {number}\nevent: warning\ndata: {{"text":\ndata: "{number}"}}\n\n: a comment\nid: 99\n'
            connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n" + body.encode())
            connection.close()

    server = threading.Thread(target=serve)
    server.start()
    events = goniod.Client(f"http://127.0.0.1:{listener.getsockname()[1]}").events()
    assert [next(events).data["text"] for _ in range(2)] == ["1", "2"]
    server.join()
    listener.close()
    assert "Last-Event-ID" not in asked[0] and "Last-Event-ID: 1\r\n" in asked[1]
