#!/usr/bin/env python3
"""Reads the JUnit files of gonioctl with junitparser, which was not written here, and compares them with what was printed.

  junit.py GONIOCTL
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from junitparser import Error, Failure, JUnitXml

gonioctl = str(Path(sys.argv[1]).resolve())


def tried(*arguments):
    """What a command prints, its exit code, and the cases of its JUnit file with the kinds of what went wrong in each."""
    with tempfile.TemporaryDirectory() as here:
        command = [gonioctl, *arguments, "--json", "--junit", "junit.xml"]
        finished = subprocess.run(command, cwd=here, capture_output=True, text=True)
        report = JUnitXml.fromfile(f"{here}/junit.xml")
    cases = [case for suite in report for case in suite]
    assert report.tests == len(cases), (report.tests, len(cases))
    wrong = {case.name: [type(result) for result in case.result] for case in cases if case.result}
    assert report.failures == sum(Failure in kinds for kinds in wrong.values())
    assert report.errors == sum(Error in kinds for kinds in wrong.values())
    return json.loads(finished.stdout), finished.returncode, [case.name for case in cases], wrong


told, code, names, wrong = tried("doctor")
assert names == [finding["check"] for finding in told["findings"]], names
assert list(wrong) == [finding["check"] for finding in told["findings"] if finding["verdict"] == "fail"], wrong

told, code, names, wrong = tried("eval", "lambert:0.5", "lambert:0.4", "--fail-above", "male=0.5,median_rel=0.1")
assert code == 1 and wrong == {"median_rel is at most 0.1": [Failure]}, (code, wrong)

told, code, names, wrong = tried("eval", "lambert:0.5", "no such <material> & \"none\"")
assert code == 2 and wrong == {"gonioctl eval": [Error]}, (code, wrong)

told, code, names, wrong = tried("campaign", "--captures", "7", "--seed", "5")
assert len(names) == told["captures"] == 7 and len(wrong) == len(told["wrong"]), (names, wrong)

told, code, names, wrong = tried("conform")
assert names == [finding["check"] for finding in told["findings"]], names
assert code == 0 and not wrong, (code, wrong)
print("junitparser reads what doctor, conform, campaign and eval found")
