"""Qualification plans: predictions, verdicts, deliveries."""

from thermid.qualify._deliver import check_delivery as check_delivery, deliver as deliver
from thermid.qualify._plan import Plan as Plan, load_plan as load_plan
from thermid.qualify._programme import Qualification as Qualification, run_plan as run_plan
from thermid.qualify._trial import Trial as Trial, pre_test as pre_test, run_test as run_test, sensors_of as sensors_of
