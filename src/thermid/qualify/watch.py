"""A growing log watched: when to stop, and what went wrong."""

from thermid.qualify._watch.growing import GrowingLog as GrowingLog, read_whole_lines as read_whole_lines, replayed as replayed
from thermid.qualify._watch.request import BoundColumns as BoundColumns, WatchRequest as WatchRequest
from thermid.qualify._watch.stopping import Stopping as Stopping, TemperatureLimit as TemperatureLimit
from thermid.qualify._watch.watcher import Watcher as Watcher, WatchLook as WatchLook, roles_of_paths as roles_of_paths
