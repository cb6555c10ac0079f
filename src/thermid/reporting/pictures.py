"""Pictures of results and logs."""

from thermid.reporting._pictures.trust import picture as picture
