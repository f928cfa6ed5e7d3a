"""The stages of a study: each reads the artefacts before it, writes its own, and knows when it is stale.

============  ============================  =========================
stage         writes                        costs
============  ============================  =========================
``plan``      ``design.csv``, ``plan.json``  nothing
``evaluate``  ``runs.jsonl``                 one run per design point
``fit``       ``model.json``,                nothing
              ``optimum.json``
``verify``    ``verification.json``          one run per optimum
============  ============================  =========================
"""
