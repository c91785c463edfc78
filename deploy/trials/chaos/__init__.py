"""The chaos monkey: injects faults into a running arm, and records it from outside.

| module | content |
|---|---|
| `__main__` | `make chaos`: the command line, from the plan to the reports |
| `schedule` | when which fault is injected: named scenarios, random faults |
| `faults`, `inject/`, `babbler`, `clock`, `partition` | the kinds of faults |
| `testbed`, `arm` | the arms under test, and the injection |
| `observer`, `process_monitor` | the record: messages, processes, faults |
| `cost` | how much processor time and memory the arms use |
"""
