"""The requirements of a scenario as JUnit XML, which continuous integration shows."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

from ..evaluation.grading import Status
from ..evaluation.results_table import Numbers
from ..terminal import escaped
from . import texts


def document(numbers: Numbers, failures: Mapping[str, str]) -> str:
    """Return a test suite with a test case for each requirement, case and point, and one for each run that failed."""
    plan = numbers.plan
    suite = ET.Element("testsuite", name=plan.name)
    for run, message in failures.items():
        case = ET.SubElement(suite, "testcase", classname=plan.name, name=escaped(f"run {run}"))
        first = next(iter(message.splitlines()), "")
        ET.SubElement(case, "error", message=escaped(first)).text = escaped(message)
    verdicts = numbers.requirements()
    for item in verdicts:
        place = "@".join(part for part in (item.case, item.point) if part)
        case = ET.SubElement(suite, "testcase", classname=plan.name, name=f"{item.metric.name}.{place}")
        text = escaped(texts.requirement(item, numbers))
        if item.status is Status.FAILED:
            ET.SubElement(case, "failure", message=text).text = text
        elif item.status is Status.OPEN:
            ET.SubElement(case, "skipped", message=f"Not evaluated: {text}")
        else:
            ET.SubElement(case, "system-out").text = text
    counts = {
        "tests": len(suite),
        "failures": sum(item.status is Status.FAILED for item in verdicts),
        "errors": len(failures),
        "skipped": sum(item.status is Status.OPEN for item in verdicts),
    }
    for name, count in counts.items():
        suite.set(name, str(count))
    ET.indent(suite)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(suite, encoding="unicode") + "\n"
