"""The running system: the manifest, supervision, processes, forks, records, parameter files."""
