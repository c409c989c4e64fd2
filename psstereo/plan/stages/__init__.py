"""Every stage, one a module; :mod:`psstereo.plan.stages.catalogue` has their order."""
