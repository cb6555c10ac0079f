"""The same program with its texts worded otherwise: what scripts/reworded.py shows the tests."""

from __future__ import annotations

import ast
import re

from .size import is_documentation

WORDS = 4
"""Words that a text has at least; shorter ones are keys, heads of columns and parts of patterns."""
QUOTED = r"(?<!\w)'[^']*'(?!\w)|`[^`]*`|\"[^\"]*\"|\{[^}]*\}|\[[^\]]*\]"
TAG = r"\A *[a-z]+:"
"""A word before the first colon: the name of a step, of a sensor, of a kind of remark."""
ALONE = re.compile(rf"({TAG}|{QUOTED})|(?<![\w.\-/\\%])[a-z]{{4,}}(?![\w\-/=(\[]|\.\w| = |://)")
VALUE = "\0"
"""Stands for a value in a formatted text."""
HELP = {"help", "description", "epilog"}


def reworded(text: str) -> str:
    """A text with its words reversed, what is quoted apart."""
    return ALONE.sub(lambda match: match[0] if match[1] else match[0][::-1], text)


def otherwise(source: str) -> str:
    """A module with its texts reworded."""
    return ast.unparse(_Rewording().visit(ast.parse(source)))


class _Rewording(ast.NodeTransformer):
    """Rewords the texts of a tree."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST:
        """Leave docstrings."""
        return node if is_documentation(node) else self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> ast.AST:
        """Leave help texts."""
        return node if node.arg in HELP else self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Leave words that are a list of words: ``"a b c".split()``."""
        is_list = isinstance(node.func, ast.Attribute) and node.func.attr == "split" and isinstance(node.func.value, ast.Constant)
        return node if is_list else self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        """Reword a text."""
        return ast.copy_location(ast.Constant(reworded(node.value)), node) if is_prose(node.value) else node

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
        """Reword the parts of a formatted text."""
        whole = "".join(str(part.value) if isinstance(part, ast.Constant) else VALUE for part in node.values)
        words = iter(re.findall(rf"{VALUE}|[^{VALUE}]+", reworded(whole) if is_prose(whole.replace(VALUE, "{}")) else whole))
        for part, text in zip(node.values, words, strict=True):
            if isinstance(part, ast.FormattedValue):
                part.value = self.visit(part.value)
            elif isinstance(part, ast.Constant):
                part.value = text
        return node


def is_prose(text: object) -> bool:
    """Whether a value is a text of some words on one line: no pattern, markup, expression, statement of a program or command of a shell."""
    return (
        isinstance(text, str)
        and not re.search(
            r"\n.|<|\(\?|\\[bdsw]|^\^|;$|\[\]$|[\w)] ?\* ?[\w({]|[\w)] / [\w({]|^thermid [a-z]|^from \S+ import |^import |\w\??\|\w", text
        )
        and len(re.findall(r"[A-Za-z]{2,}", re.sub(QUOTED, " ", text))) >= WORDS
    )
