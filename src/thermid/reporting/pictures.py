"""Pictures of results and logs."""

from thermid.reporting._pictures.chart import thinned as thinned
from thermid.reporting._pictures.look import Look as Look, clock_lines as clock_lines, clocks_of as clocks_of, look as look
from thermid.reporting._pictures.trust import picture as picture
