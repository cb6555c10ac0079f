"""A first project: proposals from a log, templates, improvements."""

from thermid.campaign._start.improve import improve as improve
from thermid.campaign._start.project import (
    TEMPLATES as TEMPLATES,
    VERDICT_NOISES as VERDICT_NOISES,
    VERDICT_SHARE_OF_RANGE as VERDICT_SHARE_OF_RANGE,
    head_copies as head_copies,
    may_write_project as may_write_project,
    parted as parted,
    write_project as write_project,
    write_template as write_template,
)
from thermid.campaign._start.proposal import StatedFacts as StatedFacts, known_masses as known_masses, propose as propose, seated as seated
from thermid.campaign._start.roles import ACCURACY as ACCURACY, Roles as Roles, roles_of as roles_of, word as word
