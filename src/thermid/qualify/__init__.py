"""From a calibrated model to a qualified box: profiles, stabilisation, limits, margins, verdicts, plans, campaigns of uncertain runs."""
