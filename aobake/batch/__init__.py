"""Folders of assets: found, compared with what was done before, baked in processes of their own, reported.

    found (discovery, config)  ->  Planned jobs  ->  Manifest: what stands, what is to be done
        ->  schedule  ->  Executor (processes here, or a cluster)  ->  Outcomes  ->  Manifest  ->  reports

run.py ties them together; each of the others knows one of them alone.
"""

__all__: list[str] = []
