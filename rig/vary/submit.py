"""Submits the cases of a campaign to a HyperQueue server, prints the number of the job, and waits until it has ended.

Arguments: the program, the folder of the campaign, the number of this start, the folder of the server or nothing. Standard input:
numbers of cases.
"""

import sys

from hyperqueue import Client, Job

program, folder, start, server = sys.argv[1:]
client = Client(server or None)
job = Job(max_fails=None)
for number in sys.stdin.read().split():
    job.program([program, "campaign-case", folder, number, start], stdout=None, stderr=None)
submitted = client.submit(job)
print(submitted.id, flush=True)
client.wait_for_jobs([submitted], raise_on_error=False)
