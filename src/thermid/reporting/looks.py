"""The drawing of a log, and what a drawing of a course keeps."""

from thermid.reporting._pictures.chart import thinned as thinned
from thermid.reporting._pictures.log import log_drawing as log_drawing
