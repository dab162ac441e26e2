"""Everything that a user may call is documented, with an example that does what it says."""

import doctest
import inspect
from pathlib import Path

import goniod
import goniod.mitsuba
import numpy as np
import pytest

OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.IGNORE_EXCEPTION_DETAIL


def public() -> dict[str, object]:
    """Every public class and function, and every public method and property, by its name."""
    found: dict[str, object] = {"goniod": goniod, "goniod.mitsuba": goniod.mitsuba}
    for module in (goniod, goniod.mitsuba):
        for name in module.__all__:
            found[f"{module.__name__}.{name}"] = thing = getattr(module, name)
            if inspect.isclass(thing):
                for key, member in vars(thing).items():
                    data = inspect.isdatadescriptor(member) and not inspect.isroutine(member)
                    if not key.startswith("_") and (inspect.isroutine(member) or data or hasattr(member, "func")):
                        found[f"{module.__name__}.{name}.{key}"] = member
    return found


NAMES = sorted(name for name, thing in public().items() if not isinstance(thing, str))
# The fields of plain records are told in the record's own documentation.
RECORDS = ("goniod.Factor.", "goniod.Event.")


@pytest.mark.parametrize("name", NAMES)
def test_has_an_example_that_runs(name, run_directory, daemon, job_toml, done_job):
    documentation = inspect.getdoc(public()[name]) or ""
    assert len(documentation.splitlines()[:1]) == 1, f"{name} has no documentation"
    if name.startswith(RECORDS):
        return
    assert ">>>" in documentation, f"{name} has no example"
    known = {
        "goniod": goniod,
        "np": np,
        "run_directory": run_directory,
        "daemon_url": daemon.url,
        "daemon_token": daemon.token,
        "job_toml": job_toml,
        "done_job": done_job,
        "waiting_toml": job_toml.replace("on_stage = true", "on_stage = false"),
    }
    example = doctest.DocTestParser().get_doctest(documentation, known, name, None, 0)
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=OPTIONS)
    assert runner.run(example, out=said.append).failed == 0, "".join(said)


def test_the_examples_of_the_page_run(run_directory, daemon, done_job, job_toml, tmp_path, monkeypatch):
    page = (Path(__file__).parents[3] / "docs/python.md").read_text("utf-8")
    blocks = [part.split("```")[0] for part in page.split("```python\n")[1:]]
    assert len(blocks) >= 5
    known = {
        "run_directory": run_directory,
        "daemon_url": daemon.url,
        "daemon_token": daemon.token,
        "job_toml": job_toml,
    }
    monkeypatch.chdir(tmp_path)
    for number, block in enumerate(blocks):
        exec(compile(block, f"example {number + 1} of docs/python.md", "exec"), known)
