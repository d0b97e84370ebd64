"""Worker processes on this machine, and calls to them; knows nothing of what they compute.

It imports little, so that a command starts the processes before it imports the rest.
"""

from runtime.experiments.processes import choice
from runtime.experiments.processes.process_executor import ProcessExecutor, WorkerDied
