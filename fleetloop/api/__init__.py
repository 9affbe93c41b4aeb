"""The Python door: what `import fleetloop` gives.

    running    `run`: a scenario to a `Run`, in this process or over processes
    result     `Run`: signals, events, verdict of a run's folder
    table      the signals of a run as a table: pandas, Arrow, Parquet
    shown      a run in a notebook and in a terminal

The names are those of `fleetloop.__init__`, which imports nothing before one is used.
"""
