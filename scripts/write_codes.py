"""Write docs/codes.md: every code of an error, warning or remark with its cause and cure, of the table in thermid.base.errors.

Run it as ``.venv/bin/python scripts/write_codes.py``; tests/architecture/test_codes.py fails when the page is not current.
"""

from __future__ import annotations

from pathlib import Path

from thermid.base.code_table import CODES, SUBJECTS

PAGE = Path(__file__).parent.parent / "docs/codes.md"
HEAD = """# Codes of messages

Errors, warnings and remarks have a code by their cause, so that a script need not read sentences: a sentence may change, its code stays.
`-v` prints it in brackets behind the text. Under `--json` an error and a finding of `check` have it as `code`, and `codes` lists the
remarks of an answer. In Python it is `error.code` and `warning.code`, of a remark `code_of(text)` of `thermid.base.errors`. A message
that has no code yet has an empty one.
"""


def page() -> str:
    """Return the page: a table for each subject."""
    out = [HEAD]
    for subject, title in SUBJECTS.items():
        rows = [
            f"| `{name}` | {code.kind} | {code.cause} | {code.cure} |" for name, code in CODES.items() if name.startswith(f"{subject}.")
        ]
        out.append("\n".join([f"## {title}\n", "| code | kind | cause | cure |", "|---|---|---|---|", *rows]) + "\n")
    return "\n".join(out)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
