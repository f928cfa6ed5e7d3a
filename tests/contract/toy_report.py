"""A toy report in one file: the responses that were fitted, a line each."""

from rsmkit.io.files.atomic_files import write_text
from rsmkit.report.writers import Writer


def write(findings, path):
    lines = [f"{len(findings.runs)} runs of {findings.study_name}", *findings.surfaces]
    write_text(path, "\n".join(lines).encode(errors="backslashreplace").decode() + "\n")


ROW = Writer("toy", "toy report", "toy.txt", write)
