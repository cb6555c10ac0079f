"""Fits whose model of error is that of their values alone, for tests of what is done with a fit and not of how far it errs.

How elements depart from their laws takes a fit several times as long as its search: some .4 to 1.4 s each. Modules that read neither bands
nor errors nor what the structure may lack take the errors of the fitted values instead, as the product does where no element can be
followed. Everything else is the product's: what is asked, kept, written, read and handed up.

`values_alone` is for modules that read nothing else; with `errors_in_turn` the same tests also run in the campaign with the product's
models of error. A test that is about them takes `errors_in_full_here`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from thermid.fit import _calibrate
from thermid.fit._error_model.kept import ErrorModel, errors_of_values

OF_FIT, SUSPECT = ErrorModel.of_fit, _calibrate._suspect


@contextmanager
def errors_of_values_alone() -> Iterator[None]:
    """Within this, models of error hold the errors of values alone, and residuals refute no structure."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_calibrate, "_suspect", lambda fit, spread: False)
        patch.setattr(ErrorModel, "of_fit", staticmethod(errors_of_values))
        yield


@contextmanager
def errors_in_full() -> Iterator[None]:
    """Within this, models of error are the product's again: for one test of a module that else does without."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_calibrate, "_suspect", SUSPECT)
        patch.setattr(ErrorModel, "of_fit", OF_FIT)
        yield
